"""The double integrator under white noise in holds, conditioned on its end: known exactly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

from mlci.sampled.passage import Passage
from mlci.simulate import rollout
from mlci.spaces import Box, Floats
from mlci.systems import DoubleIntegrator

WIDE = DoubleIntegrator(position_limit=50.0, speed_limit=50.0, control_limit=2.0)


@dataclass(frozen=True, eq=False)
class Bridge:
    """Controls are independent Gaussians, so that the end is one, and they given the end."""

    passage: Passage

    @property
    def variance(self) -> float:
        return self.passage.temperature / (2 * self.passage.dt)

    @property
    def reach(self) -> Floats:
        """(2, T) derivative of the end by the controls."""
        dt, later = self.passage.dt, np.arange(self.passage.steps)[::-1]
        return np.array([dt**2 / 2 + dt**2 * later, np.full(len(later), dt)])

    @property
    def end_without_control(self) -> Floats:
        start, time = self.passage.start, self.passage.dt * self.passage.steps
        return np.array([start[0] + start[1] * time, start[1]])

    @property
    def end_covariance(self) -> Floats:
        return self.variance * self.reach @ self.reach.T

    def log_density_of_end(self, ends: Floats) -> Floats:
        apart = ends - self.end_without_control
        squares = np.einsum("...i,ij,...j", apart, np.linalg.inv(self.end_covariance), apart)
        return -squares / 2 - np.log(2 * np.pi) - np.linalg.slogdet(self.end_covariance)[1] / 2

    @property
    def log_z(self) -> float:
        """By Gauss and Legendre's rule over the goal."""
        nodes, weights = np.polynomial.legendre.leggauss(60)
        goal = self.passage.goal
        points = goal.lower + (nodes[:, None] + 1) / 2 * goal.widths
        ends = np.stack(np.meshgrid(*points.T, indexing="ij"), axis=-1)
        density = np.exp(self.log_density_of_end(ends)) * np.outer(weights, weights)
        free = self.passage.steps / 2 * np.log(2 * np.pi * self.variance)
        return float(np.log(np.sum(density) * np.prod(goal.widths) / 4) + free)

    def ends(self, count: int, rng: np.random.Generator) -> Floats:
        """(B, 2) ends in the goal, by rejection."""
        goal, side = self.passage.goal, np.linspace(0, 1, 41)
        share = np.stack(np.meshgrid(side, side), axis=-1)
        highest = np.max(self.log_density_of_end(goal.lower + share * goal.widths)) + 0.05
        ends = rng.uniform(goal.lower, goal.upper, (6 * count, 2))
        kept = np.log(rng.random(len(ends))) < self.log_density_of_end(ends) - highest
        return ends[kept][:count]

    def paths(self, count: int, rng: np.random.Generator) -> Floats:
        """(B, K+1, 2) paths: ends by rejection, then controls given the end."""
        ends = self.ends(count, rng)
        free = rng.normal(0, np.sqrt(self.variance), (len(ends), self.passage.steps))
        apart = ends - (self.end_without_control + free @ self.reach.T)
        pull = self.variance * self.reach.T @ np.linalg.inv(self.end_covariance)
        controls = (free + apart @ pull.T)[..., None]
        start, dt = self.passage.start, self.passage.dt
        return rollout(self.passage.system, start, controls, dt, self.passage.substeps)

    def chance_of_rise(self, height: float, count: int, rng: np.random.Generator) -> float:
        """Probability that the position comes above a height, by few samples however rare it is.

        Given the end, positions are Gaussian: p_k that the k-th is above. A path in which the k-th
        is, k drawn by p_k, has the weight sum p_k over the number of its positions that are (Adler,
        Blanchet and Liu 2012).
        """
        dt, substeps = self.passage.dt, self.passage.substeps
        times = dt / substeps * np.arange(self.passage.steps * substeps + 1)[:, None]
        begin = dt * np.arange(self.passage.steps)
        for_ = np.clip(times - begin, 0.0, dt)
        by_control = for_**2 / 2 + for_ * np.maximum(times - begin - dt, 0.0)
        pull = self.variance * self.reach.T @ np.linalg.inv(self.end_covariance)
        ends = self.ends(count, rng) - self.end_without_control
        drift = self.passage.start[0] + self.passage.start[1] * times[:, 0]
        means = drift + ends @ (by_control @ pull).T
        rest = np.eye(self.passage.steps) - pull @ self.reach
        root = np.sqrt(self.variance) * by_control @ rest
        covariance = root @ root.T
        spread = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
        chances = ndtr((means - height) / spread)
        total = np.sum(chances, axis=1)
        point = np.sum(np.cumsum(chances, axis=1) < rng.random((len(ends), 1)) * total[:, None], 1)
        at = np.arange(len(ends)), point
        free = means + rng.standard_normal((len(ends), root.shape[1])) @ root.T
        tail = ndtr((means[at] - height) / spread[point]) * rng.random(len(ends))
        above = means[at] - spread[point] * ndtri(tail)
        pulled = covariance[point] / np.square(spread[point])[:, None]
        positions = free + (above - free[at])[:, None] * pulled
        number = np.maximum(np.sum(positions > height - 1e-9, axis=1), 1)
        return float(np.mean(total / number))


def random_bridge(rng: np.random.Generator, steps: int = 12) -> Bridge:
    """Between random states, at some temperature, to a goal that is narrow or wide."""
    start, middle = rng.uniform(-2, 2, (2, 2))
    half, temperature = rng.choice([0.05, 0.2, 0.8]), float(rng.choice([0.3, 1.0, 3.0]))
    goal = Box(middle - half, middle + half)
    return Bridge(Passage(WIDE, start, goal, steps, 0.25, temperature, substeps=4))
