"""How a command starts and ends: signals, the config from the command line, exit codes.

What a command does is imported late, so that Ctrl-C ends it quietly from the start, and so that
--help and --version need not wait for it.
"""

from __future__ import annotations

import errno
import gc
import os
import re
import signal
import sys
import traceback
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

# Exit codes of all commands: all is done, something failed, the config is wrong, Ctrl-C.
DONE, FAILED, REFUSED, STOPPED = 0, 1, 2, 130
# Objects that are made before the collector looks for circles among them; its default is 700.
_MADE_BEFORE_A_LOOK = 50_000


def run() -> int:
    """`mlci-run`: experiments/run.py."""
    return _start("experiments.run", help_file="config.txt")


def infer() -> int:
    """`mlci-infer`: experiments/infer.py."""
    of_table = any(word.startswith("table=") for word in sys.argv[1:])
    return _start("experiments.infer", "infer_table.txt" if of_table else "infer.txt")


def advise() -> int:
    """`mlci-advise`: experiments/advise.py."""
    return _start("experiments.advise", help_file="advise.txt")


def results() -> int:
    """`mlci-results`: experiments/results.py."""
    return _start("experiments.results")


def figures() -> int:
    """`mlci-figures`: paper_figures."""
    return _start("paper_figures.__main__")


def report() -> int:
    """`mlci-report`: paper_figures.report."""
    return _start("paper_figures.report.__main__")


def version_base() -> dict[str, str]:
    """The argument of that name for Hydra: 1.3 warns if it is left out, 1.4 if it is given."""
    import hydra

    return {"version_base": "1.3"} if hydra.__version__.startswith("1.3.") else {}


def run_command(
    config_name: str,
    act: Callable[[dict[str, Any]], int],
    failures: tuple[type[Exception], ...] = (),
    *,
    register_sweeper: Callable[[], None] | None = None,
) -> int:
    """Compose a config from the command line, and act on it.

    Args:
        config_name: a file of conf/.
        act: takes the resolved config and returns the exit status.
        failures: errors that say all there is to say.
        register_sweeper: makes known to Hydra what runs a sweep; None for a command that has none.
            A config may ask for a sweep without -m.

    Returns:
        the status of `act`; FAILED, REFUSED for a wrong config, or STOPPED after Ctrl-C.
    """
    import hydra
    from hydra.core.hydra_config import HydraConfig
    from hydra.types import RunMode
    from omegaconf import DictConfig

    from experiments.config.command_line import command_words
    from experiments.config.explain import explain, of_config
    from experiments.config.paths import CONF
    from experiments.config.quick_yaml import read_yaml_in_c
    from experiments.config.read import ConfigError, plain_tree
    from experiments.terminal import complain

    def task(config: DictConfig) -> None:
        """The work, outside Hydra's own handling of errors."""
        try:
            status = act(plain_tree(config))
            sys.stdout.flush()
        except ConfigError as error:
            complain(str(error))
            raise SystemExit(REFUSED) from None
        except failures as error:
            complain(str(error))
            raise SystemExit(FAILED) from None
        except Exception as error:
            if not _cannot_print(error):
                traceback.print_exc()
            raise SystemExit(FAILED) from None
        if status != DONE:
            raise SystemExit(status)

    def composed(words: list[str]) -> DictConfig | None:
        """The config, composed once; None if it asks for a sweep, or may ask for one."""
        try:
            with hydra.initialize_config_dir(str(CONF), **version_base()):
                config = hydra.compose(config_name, words, return_hydra_config=True)
        except Exception as error:
            if register_sweeper is None or "--multirun" not in str(error):
                raise
            return None  # several values of a key
        return None if config.hydra.mode is RunMode.MULTIRUN else config

    read_yaml_in_c()
    os.environ["HYDRA_FULL_ERROR"] = "1"  # Hydra raises its errors, and they are worded here
    try:
        sys.argv[1:] = words = command_words(sys.argv[1:])
        config = None if any(word.startswith("-") for word in words) else composed(words)
        if config is None:  # Hydra's own way, which composes twice or more
            if register_sweeper is not None:
                register_sweeper()
            hydra.main(config_path=str(CONF), config_name=config_name, **version_base())(task)()
        else:
            HydraConfig.instance().set_config(config)  # for interpolations
            task(config)
    except KeyboardInterrupt:
        return STOPPED
    except failures as error:
        complain(str(error))
        return FAILED
    except Exception as error:
        if isinstance(error, OSError) and not of_config(error):
            # No room or no right to write: nothing that a config could mend.
            complain(f"{error}; what has finished is kept")
            return FAILED
        complain(explain(error))
        return REFUSED
    return DONE


def _start(module: str, help_file: str | None = None) -> int:
    """Import a module, which takes a second, and run its `main`; returns the exit status.

    Args:
        module: of the command.
        help_file: in conf/help, what it says to --help; None if `main` answers that.
    """
    if "--version" in sys.argv[1:]:
        print(_version())
        return DONE
    if help_file is not None and {"--help", "-h"}.intersection(sys.argv[1:]):
        print(_help(help_file), end="")
        return DONE
    # Python itself adds the folder of the file that it was given, where a module of ours could be
    # taken for a user's. The current folder stays out until a config names a module in it.
    ours = os.path.dirname(os.path.abspath(__file__))
    sys.path[:] = [path for path in sys.path if os.path.abspath(path) != ours]
    os.environ["PYTHONSAFEPATH"] = "1"  # nor do worker processes look there as they start
    usual = signal.getsignal(signal.SIGINT)
    if usual is not signal.SIG_IGN:  # which it is in the background of a script
        signal.signal(signal.SIGINT, _leave)
    # Little that a command makes is garbage in circles, and looking takes a tenth of its time.
    gc.set_threshold(_MADE_BEFORE_A_LOOK)
    main = import_module(module).main
    gc.freeze()
    try:
        signal.signal(signal.SIGINT, usual)
        status: int = main()
    except KeyboardInterrupt:
        status = STOPPED
    if usual is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, _leave)  # while the interpreter ends
    return status


def _version() -> str:
    """Version of mlci, and the checkout's commit; mlci is not imported, as that loads scipy."""
    from experiments.tracking.environment import commit_words

    source = Path(__file__).parents[1] / "mlci" / "__init__.py"
    (number,) = re.findall('^__version__ = "(.+)"$', source.read_text(encoding="utf-8"), re.M)
    return f"mlci {number}{commit_words()}"


def _help(name: str) -> str:
    """A text of conf/help, with the names that the commands have here."""
    from experiments.config.paths import CHECKOUT, CONF

    text = (CONF / "help" / name).read_text(encoding="utf-8")
    return text if CHECKOUT else re.sub(r"python experiments/(\w+)\.py", r"mlci-\1", text)


def _cannot_print(error: Exception) -> bool:
    """Whether nobody reads what is printed any more, or there is no room; the latter is told."""
    from experiments.terminal import print_nowhere

    if not (isinstance(error, OSError) and error.errno in (errno.EPIPE, errno.ENOSPC)):
        return False
    if error.errno == errno.ENOSPC:
        print(f"{error}; what has finished is kept", file=sys.stderr)
    print_nowhere()
    return True


def _leave(*_: Any) -> None:
    """End without a word, as nothing has begun, or all is done; an exception might be caught."""
    os._exit(STOPPED)
