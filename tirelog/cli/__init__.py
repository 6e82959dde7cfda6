"""The command line.

The only place that knows typer and rich, and the one place that decides the exit status.

Every error becomes `tirelog: error: FILE[:line]: what is wrong; what is allowed; what to do` on
standard error; `--debug` (or TIRELOG_DEBUG=1) shows the traceback as well. Standard output is for
the next program: a reader that leaves is not an error.
"""

from __future__ import annotations

import os
import re
import signal
import sys
import warnings
from contextlib import nullcontext, suppress
from typing import Any

from tirelog.errors import (
    OUTSIDE_LOG,
    ExitStatus,
    OutputError,
    TirelogError,
    system_message,
)


def _status_of(problem: BaseException, command: str) -> int:
    """The exit status for a problem in a `command`, which is printed on standard error."""
    from tirelog.cli.session import say
    from tirelog.vocabulary.units import likely_number

    if isinstance(problem, TirelogError):
        text, status = str(problem), int(problem.exit_status)
    elif isinstance(problem, KeyboardInterrupt) or type(problem).__name__ == "Abort":
        name = str(problem) if str(problem).startswith("SIG") else "SIGINT"
        how = "interrupted" if name == "SIGINT" else f"stopped ({name})"
        text = f"{how}; nothing was left under the result's name; start it again"
        status = 128 + signal.Signals[name]  # the status that a shell gives
    elif type(problem).__name__ == "NoArgsIsHelpError":
        with suppress(OSError, ValueError):
            sys.stderr.write(f"{problem}\n")
        return int(ExitStatus.UNUSABLE_REQUEST)
    elif hasattr(problem, "format_message") and hasattr(
        problem, "exit_code"
    ):  # a usage error of typer's own parser
        text = f"{problem.format_message().rstrip('.')}; see {command} --help"
        number = re.search(r"'([^']*)' is not a valid (?:float|int)", text)
        if number is not None and (likely := likely_number(number[1])):
            text += f"; {likely}"
        if text.startswith("Missing option '--model'"):
            text += "; `tirelog model new --setup SETUP.toml -o MODEL.toml` makes a model"
        status = int(ExitStatus.UNUSABLE_REQUEST)
    elif isinstance(problem, OSError) and problem.errno in OUTSIDE_LOG:
        text, status = system_message(problem), int(ExitStatus.UNUSABLE_REQUEST)
    elif isinstance(problem, MemoryError):
        text, status = "out of memory; give a shorter log or free some", int(ExitStatus.DEFECT)
    else:
        text = (
            f"a defect of tirelog's own ({type(problem).__name__}: {problem}); run it again with "
            "--debug and report the traceback"
        )
        status = int(ExitStatus.DEFECT)
    say(f"error: {text}")
    return status


def _command_of(parsed: Any, arguments: list[str]) -> str:
    """The command whose help has the options of a command line, as it is typed."""
    command = "tirelog"
    for word in arguments:
        below = getattr(parsed, "commands", {})
        if word in below:
            command, parsed = f"{command} {word}", below[word]
        elif not word.startswith("-"):
            break
    return command


def run(arguments: list[str] | None = None) -> int:
    """Carry out a command line; its exit status."""
    from tirelog.cli.session import drop_output, endings_unwind, say
    from tirelog.runtime import hearing

    arguments = sys.argv[1:] if arguments is None else arguments
    completes = "_TIRELOG_COMPLETE" in os.environ
    parsed: Any = None
    debug = "--debug" in arguments or bool(os.environ.get("TIRELOG_DEBUG"))
    try:
        from tirelog.cli.app import command  # in here, so that an interrupt meanwhile is one too
        from tirelog.storage.whole import inputs_kept

        parsed = command(arguments[0] if arguments and not completes else "")
        if completes:  # the shell asks for completions
            parsed.main(prog_name="tirelog")
        # not main(): it would turn a reader that leaves (`| head`) into status 1
        hears = nullcontext() if "--quiet" in arguments else hearing(say)
        with endings_unwind(), inputs_kept(), warnings.catch_warnings(), hears:
            if not debug and not sys.warnoptions:  # a library's warning is no message to a user
                warnings.simplefilter("ignore")
            with parsed.make_context(
                "tirelog", [a for a in arguments if a != "--debug"]
            ) as context:
                parsed.invoke(context)
            sys.stdout.flush()
        return int(ExitStatus.DONE)
    except BrokenPipeError:
        drop_output()
        return int(ExitStatus.DONE)
    except SystemExit as leaving:
        return int(leaving.code or 0)
    except BaseException as problem:
        if type(problem).__name__ == "Exit":
            return int(getattr(problem, "exit_code", 0))
        if debug:
            import traceback

            traceback.print_exc()
        return _status_of(problem, _command_of(parsed, arguments))


def main() -> None:
    """Entry point of the console script."""
    from tirelog.cli.session import drop_output, open_streams
    from tirelog.runtime import few_collections, leave, one_heap, one_thread, share_work

    one_thread()  # first of all: a command's inputs are looked at before it begins
    few_collections()
    open_streams()
    one_heap()
    share_work()
    status = run()
    try:
        sys.stdout.flush()
    except (OSError, OutputError):  # the reason is printed already
        drop_output()
    leave(status)
