"use strict";
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const byId = (id) => document.getElementById(id);
  const FEW = 10, BEST = 5, LITTLE = 100; // rows; regions that are numbered; thousandths of a nat
  const column = new Map(data.detailed.map((region, k) => [region, k]));
  const unseen = new Set(data.unseen), entered = data.entered.map((regions) => new Set(regions));
  const state = { stop: data.stops.length - 1, region: 0, plane: 0, all: false };

  // Words for the numbers, which are whole thousandths.
  const of100 = (p) => p === -1 ? "under 0.1" : p === 1001 ? "over 99.9" : (p / 10).toFixed(1);
  const nat = (g) => g === null ? "ruled out" : g === "inf" ? "unavoidable" : (g / 1000).toFixed(3);
  const size = (g) => g === null ? -1 : g === "inf" ? Infinity : g;
  const place = (rank) => Number.isInteger(rank) ? String(rank) : rank.toFixed(1);
  const plural = (n, noun) => n + " " + noun + (n === 1 ? "" : "s");

  const element = (tag, text, attributes) => {
    const made = document.createElement(tag);
    if (text !== undefined && text !== "") made.textContent = text;
    for (const name in attributes || {}) made.setAttribute(name, attributes[name]);
    return made;
  };
  const drawn = (tag, attributes, text) => {
    const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const name in attributes) made.setAttribute(name, attributes[name]);
    if (text !== undefined) made.textContent = text;
    return made;
  };

  // What is so at the slider's stop.
  const count = () => data.stops[state.stop];
  const rank = (i) => data.rank[state.stop][i];
  const gain = (i) => data.gain[state.stop][i];
  const chance = (i) => data.chance[state.stop][i];
  const entries = (i) => entered.slice(0, count()).filter((regions) => regions.has(i)).length;
  const order = () => data.regions.map((_, i) => i).sort((a, b) => rank(a) - rank(b) || a - b);

  // A region's colour: the square root of its gain on the ramp.
  const mixed = (share) => {
    const at = share * (data.ramp.length - 1), k = Math.min(Math.floor(at), data.ramp.length - 2);
    const part = (hex, c) => parseInt(hex.slice(1 + 2 * c, 3 + 2 * c), 16);
    const channel = (c) => {
      const from = part(data.ramp[k], c), to = part(data.ramp[k + 1], c);
      return Math.round(from + (at - k) * (to - from)).toString(16).padStart(2, "0");
    };
    return "#" + channel(0) + channel(1) + channel(2);
  };
  const fill = (i) => {
    if (gain(i) === null) return "url(#entered)";
    if (gain(i) === "inf") return "#1a1a1a";
    if (unseen.has(i) && !entries(i)) return "url(#unseen)";
    return mixed(Math.sqrt(Math.min(Math.max(size(gain(i)), 0), data.top) / data.top));
  };

  const maps = [...document.querySelectorAll(".map")].map((figure) => ({
    figure,
    places: [...figure.querySelectorAll(".place")].map((shape) => ({
      shape,
      regions: shape.dataset.regions.split(" ").map(Number),
      x: Number(shape.dataset.x),
      y: Number(shape.dataset.y),
    })),
    paths: [...figure.querySelectorAll(".paths > .path")],
    ranks: figure.querySelector(".ranks"),
    chosen: figure.querySelector(".ring.chosen"),
    focused: figure.querySelector(".ring.focused"),
  }));
  const map = () => maps[state.plane];
  const best = (regions) => regions.reduce((a, b) => (rank(b) < rank(a) ? b : a));
  const outline = (here) => here.shape.querySelector("path").getAttribute("d");
  const placeOf = (region) => map().places.find((here) => here.regions.includes(region));

  const label = (here) => {
    const i = best(here.regions), more = here.regions.length - 1;
    const words = ["Region " + data.regions[i][0], data.regions[i][1], "place " + place(rank(i)),
      "how likely: " + of100(chance(i)) + " of 100"];
    if (entries(i)) words.push("entered by " + plural(entries(i), "demonstration"));
    else if (unseen.has(i)) words.push("on the way of no task that was recorded");
    if (more) words.push("and " + plural(more, "other region") + " at this place");
    return words.join("; ");
  };

  const drawMap = () => {
    const first = order().filter((i) => size(gain(i)) > 0).slice(0, BEST);
    maps.forEach((it, k) => { it.figure.hidden = k !== state.plane; });
    const here = map();
    here.places.forEach((one) => {
      one.shape.querySelector("path").setAttribute("fill", fill(best(one.regions)));
      one.shape.querySelector("title").textContent = label(one);
      one.shape.setAttribute("aria-pressed", String(one.regions.includes(state.region)));
      one.shape.setAttribute("tabindex", one.regions.includes(state.region) ? "0" : "-1");
    });
    here.paths.forEach((path, j) => {
      const { kind, much } = reason(j, state.region);
      path.setAttribute("class", "path" + (j >= count() ? " off" : kind === "against" ? " against" : much ? " for" : ""));
    });
    const marked = new Set();
    here.ranks.replaceChildren(...first.flatMap((i) => {
      const at = placeOf(i);
      if (!at || marked.has(at)) return [];
      marked.add(at);
      const text = { x: at.x, y: at.y + 5, "text-anchor": "middle" };
      const word = place(rank(i)), half = word.length > 1 ? 4 + 5 * word.length : 11;
      const plate = { x: at.x - half, y: at.y - 11, width: 2 * half, height: 22, rx: 11 };
      return [drawn("rect", plate), drawn("text", text, word)];
    }));
    const chosen = placeOf(state.region);
    here.chosen.setAttribute("d", chosen ? outline(chosen) : "");
  };

  // What demonstration j says of region i, and why.
  const reason = (j, i) => {
    const k = column.get(i);
    if (entered[j].has(i)) return { kind: "against", why: "enters the region" };
    if (!data.reachable[j]) return { kind: "none", why: "the model cannot reach its goal" };
    if (data.decided[j].includes(i)) {
      return { kind: "none", why: "only the cell of its start or goal makes entering certain" };
    }
    if (k === undefined) return { kind: "none", why: "not on this page" };
    if (data.phi[j][k] === 0) return { kind: "none", why: "the region is not on the way of its task" };
    const brings = size(data.evidence[j][k]);
    return { kind: brings > 0 ? "for" : "none", why: "keeps out", much: brings >= LITTLE };
  };

  const facts = (i) => {
    const visits = entries(i);
    return [
      data.regions[i][1][0].toUpperCase() + data.regions[i][1].slice(1) + ".",
      "Place " + place(rank(i)) + " of " + data.regions.length + "; how likely: " + of100(chance(i))
        + " of 100; evidence: " + nat(gain(i)) + (Number.isInteger(gain(i)) ? " nat" : "") + ".",
      visits ? "Entered by " + plural(visits, "demonstration") + "." : "Entered by no demonstration.",
      unseen.has(i) ? "It is on the way of no task that was recorded: keeping out says nothing." : "",
    ].filter(Boolean).join(" ");
  };

  // A table of demonstrations that say the same of region i.
  const reasonTable = (found, kind, i) => {
    const k = column.get(i), calibrated = data.forecast !== undefined && kind === "for";
    const table = element("table"), head = element("tr"), body = element("tbody"), top = element("thead");
    const titles = ["demonstration", "would enter, of 100"].concat(calibrated ? ["calibrated"] : [],
      ["evidence [nat]"], kind === "for" ? [] : ["why"]);
    titles.forEach((text) => head.append(element("th", text, { scope: "col" })));
    found.forEach((one) => {
      const row = element("tr", "", { "data-demonstration": one.j });
      const known = k !== undefined && data.reachable[one.j];
      const cells = [one.name, known ? of100(data.phi[one.j][k]) : "–"].concat(
        calibrated ? [known ? of100(data.forecast[one.j][k]) : "–"] : [],
        [k === undefined ? "–" : nat(data.evidence[one.j][k])], kind === "for" ? [] : [one.why]);
      row.append(...cells.map((text) => element("td", text)));
      body.append(row);
    });
    top.append(head);
    table.append(top, body);
    const scroll = element("div", "", { class: "scroll" });
    scroll.append(table);
    return scroll;
  };
  const folded = (title, table) => {
    const details = element("details");
    details.append(element("summary", title), table);
    return details;
  };

  // What demonstrations say of region i: headings, and tables below them.
  const KINDS = [
    ["for", "speaks for it", "speak for it", "Kept out of it. Would enter: how often somebody without "
      + "such a rule would enter it on the way of this task."],
    ["against", "speaks against it", "speak against it", "Enters it."],
    ["none", "says nothing", "say nothing", ""],
  ];
  const kindsOf = (i) => gain(i) === null ? [KINDS[1], KINDS[0], KINDS[2]] : KINDS; // what decides, first
  const reasonsOf = (i) => kindsOf(i).flatMap(([kind, one, many, text]) => {
    const found = data.names.map((name, j) => ({ name, j, ...reason(j, i) }))
      .filter((each) => each.j < count() && each.kind === kind);
    const heading = element("h3", plural(found.length, "demonstration") + " " + (found.length === 1 ? one : many));
    if (!found.length) return [heading];
    if (kind === "none") return [heading, folded("Which, and why", reasonTable(found, kind, i))];
    const parts = [heading, element("p", text, { class: "quiet" })];
    if (kind === "against") return [...parts, reasonTable(found, kind, i)];
    const of = (each) => size(data.evidence[each.j][column.get(i)]);
    found.sort((a, b) => of(b) - of(a) || a.j - b.j);
    const much = found.filter((each) => each.much), little = found.filter((each) => !each.much);
    return [...parts, ...(much.length ? [reasonTable(much, kind, i)] : []),
      ...(little.length ? [folded(little.length + " with less than 0.1 nat each", reasonTable(little, kind, i))] : [])];
  });

  const drawRegion = () => {
    const i = state.region, at = placeOf(i), others = at ? at.regions : [i];
    byId("region-title").textContent = "Region " + data.regions[i][0];
    byId("facts").textContent = facts(i);
    byId("others").hidden = others.length < 2;
    byId("other").replaceChildren(...others.slice().sort((a, b) => rank(a) - rank(b) || a - b).map((one) => {
      const text = data.regions[one][0] + ": place " + place(rank(one)) + ", " + data.regions[one][1];
      const option = element("option", text, { value: one });
      option.selected = one === i;
      return option;
    }));
    const parts = reasonsOf(i);
    if (column.get(i) === undefined) {
      parts.unshift(element("p", "What single demonstrations say is on this page for the "
        + plural(data.detailed.length, "likeliest region") + " only; the tables beside it have the others."));
    }
    byId("reasons").replaceChildren(...parts);
  };

  const drawTable = () => {
    const shown = order().slice(0, state.all ? undefined : FEW);
    if (!shown.includes(state.region)) shown.push(state.region);
    byId("rows").replaceChildren(...shown.map((i) => {
      const row = element("tr", "", i === state.region ? { class: "chosen" } : {});
      const cell = element("td"), button = element("button", data.regions[i][0], { type: "button" });
      button.setAttribute("aria-label", "Region " + data.regions[i][0]);
      button.addEventListener("click", () => select(i));
      cell.append(button);
      row.append(element("td", place(rank(i))), cell, element("td", data.regions[i][1]),
        element("td", of100(chance(i))), element("td", nat(gain(i))), element("td", String(entries(i))));
      return row;
    }));
    byId("all").hidden = data.regions.length <= FEW;
    byId("all").textContent = state.all ? "Show the first " + FEW : "Show all " + data.regions.length;
  };

  const drawAfter = () => {
    const first = order()[0], n = count(), total = data.names.length, none = of100(data.none[state.stop]);
    const head = n === total ? "After all " + plural(total, "demonstration") : "After the first " + n + " of "
      + plural(total, "demonstration") + (n ? " (last: " + data.names[n - 1] + ")" : "");
    const what = size(gain(first)) > 0 ? "region " + data.regions[first][0] + " comes first, how likely: "
      + of100(chance(first)) + " of 100" : "no region stands out";
    byId("after").textContent = head + ": " + what + "; that nothing is avoided: " + none + " of 100.";
    byId("count").setAttribute("aria-valuetext", n + " of " + total);
  };

  const draw = () => { drawMap(); drawRegion(); drawTable(); drawAfter(); };
  const select = (i) => { state.region = i; draw(); };

  // Keys on the map: arrows go to the nearest region that way, Enter or the space bar selects.
  const WAYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  const neighbour = (from, [dx, dy]) => {
    const cost = (to) => {
      const along = (to.x - from.x) * dx + (to.y - from.y) * dy;
      const aside = Math.abs((to.x - from.x) * dy) + Math.abs((to.y - from.y) * dx);
      return along > 0.5 ? along + 3 * aside : Infinity;
    };
    const to = map().places.reduce((a, b) => (cost(b) < cost(a) ? b : a));
    return cost(to) < Infinity ? to : from;
  };
  maps.forEach((it) => it.places.forEach((here) => {
    const { shape } = here;
    shape.addEventListener("click", () => { select(best(here.regions)); });
    shape.addEventListener("focus", () => { it.focused.setAttribute("d", outline(here)); });
    shape.addEventListener("blur", () => { it.focused.setAttribute("d", ""); });
    shape.addEventListener("keydown", (event) => {
      if (WAYS[event.key]) neighbour(here, WAYS[event.key]).shape.focus();
      else if (event.key === "Enter" || event.key === " ") select(best(here.regions));
      else return;
      event.preventDefault();
    });
  }));

  byId("count").max = data.stops.length - 1;
  byId("count").value = state.stop;
  byId("count").addEventListener("input", (event) => { state.stop = Number(event.target.value); draw(); });
  byId("plane").addEventListener("change", (event) => { state.plane = Number(event.target.value); draw(); });
  byId("planes").hidden = maps.length < 2;
  byId("other").addEventListener("change", (event) => select(Number(event.target.value)));
  byId("all").addEventListener("click", () => { state.all = !state.all; drawTable(); });
  byId("reasons").addEventListener("mouseover", (event) => {
    const row = event.target.closest("tr[data-demonstration]");
    map().paths.forEach((path, j) => path.classList.toggle("named", row !== null && Number(row.dataset.demonstration) === j));
  });
  byId("reasons").addEventListener("mouseleave", () => { map().paths.forEach((path) => path.classList.remove("named")); });
  const unfold = (open) => document.querySelectorAll("details").forEach((each) => { each.open = open; });
  window.addEventListener("beforeprint", () => unfold(true));
  byId("top").textContent = (data.top / 1000).toFixed(2);
  select(order()[0]);
})();
