"""`tirelog compare | diagnose | form | ladder | propose LOG... --model M`, `report`, `campaign`.

Question (logs, model, options) --ask--> answer
    --> remarks, picture, and the answer as a page, a table or JSON
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer

import tirelog.api as api
from tirelog.cli import options, pages
from tirelog.cli.session import Session, campaign_progress, say, write_json
from tirelog.errors import ExitStatus, UsageError, printable, refuse_unknown
from tirelog.vocabulary.tables import ERRORS_BY

Answer = TypeVar("Answer")


@dataclass(frozen=True)
class Question:
    """Logs, a model and the options that these commands share."""

    logs: options.Logs
    model: options.ModelFile
    setup: options.SetupFile = None
    output: options.Output = None
    format: options.Format = None
    quiet: options.Quiet = False
    channel: options.ChannelName = None
    effects: options.EffectsFile = None
    plot: options.Plot = None

    @cached_property
    def session(self) -> Session:
        """The session that reads the logs and writes the answer."""
        return Session(self.setup, self.quiet, self.output, self.format)

    @contextmanager
    def answered(
        self, doing: str, ask: Callable[[api.answers.MeasuredLogs, api.models.Model], Answer]
    ) -> Iterator[Answer]:
        """The answer, in the session; a log that cannot be read is left out, with an error."""
        with self.session as session:
            read = api.models.load_model(self.model, effects=self.effects)
            found = api.answers.measure(session.recordings(self.logs), read, self.channel)
            session.note(*found.notes)
            with session.working_on(doing):
                answer = ask(found, read)
            yield answer

    def request(self, model: Path) -> api.answers.ReportRequest:
        """The request from which a command line on the same logs and this model is made."""
        return api.answers.ReportRequest(
            tuple(self.logs), self.setup, model, channel=self.channel, effects=self.effects
        )

    def show(self, answer: Any, remarks: Iterable[str]) -> None:
        """Print the remarks, and draw the picture if one is asked for."""
        self.session.note(*remarks)
        if self.plot is not None:
            others = answer.draw(self.plot)
            self.session.note(*(f"wrote a second picture, {beside}" for beside in others))


def with_question(command: Callable[..., None]) -> Callable[..., None]:
    """The command with the options of a Question, its first argument, before or among its own.

    An option of its own takes the place of the question's of that name.
    """
    shared = inspect.signature(Question, eval_str=True).parameters
    own = dict(list(inspect.signature(command, eval_str=True).parameters.items())[1:])

    def run(**given: Any) -> None:
        asked = {name: given.pop(name) for name in shared if name not in own}
        command(Question(**asked), **given)

    run.__doc__ = command.__doc__
    options.with_options(run, {**shared, **own}.values())
    return run


def write_answer(
    session: Session,
    name: str,
    answer: Any,
    page: Iterable[str | api.answers.AnswerTable] = (),
) -> None:
    """The answer as JSON, as a page if it has one, or as a table `name` of its rows."""
    if session.json:
        write_json(answer.to_json(), session.output)
    elif page and session.paged:
        pages.print_answer(page)
    else:
        session.write_rows(name, [answer.rows()])


@with_question
def compare(
    asked: Question,
    by: Annotated[
        str | None,
        typer.Option(
            "--by",
            help="A table of errors by revolution, angle, speed, regime or conditions; with a "
            "[road] in the setup by hit.",
        ),
    ] = None,
    against: Annotated[
        list[Path] | None,
        typer.Option("--against", help="Another model file to rank on the same logs; repeatable."),
    ] = None,
    learn: Annotated[
        bool,
        typer.Option(
            "--learn", help="Also what a residual learnt on the other manoeuvres would gain."
        ),
    ] = False,
) -> None:
    """Validation error of a model beside the noise floor (repeatability of the revolutions).

    The model is fitted on some manoeuvres (segments); the held-out error is that on the others.
    """
    if by is not None:
        refuse_unknown(by, ERRORS_BY, f"--by {by}", do="choose one")
        if against:
            raise UsageError(
                f"--by {by} with --against",
                allowed="models are ranked on the page and in its json",
                do="leave one out",
            )
    others = [api.models.load_model(path, effects=asked.effects) for path in against or ()]
    ask = partial(api.answers.compare, others=others, learn=learn)
    with asked.answered("fitting the model", ask) as result:
        parts = None if by is None else result.by(by)
        asked.show(result, result.notes)
        if parts is None:
            write_answer(asked.session, "compare", result, result.page())
            follows = asked.request(asked.model).command("diagnose", model=True)
            asked.session.say(f"next: {follows}")
        else:
            asked.session.write_rows("compare", parts)


@with_question
def diagnose(
    asked: Question,
    leave_one_out: Annotated[
        str | None,
        typer.Option(
            metavar="log|tire",
            help="Diagnose without each log, or tire, in turn: where does the verdict change?",
        ),
    ] = None,
) -> None:
    """Which effect the model lacks, which effects cannot be separated, and what to drive next."""
    if leave_one_out not in (None, "log", "tire"):
        raise UsageError(
            f"--leave-one-out {leave_one_out}", allowed="allowed are log, tire", do="choose one"
        )
    ask = partial(
        api.answers.diagnose,
        leave_one_out=asked.session.tires if leave_one_out == "tire" else bool(leave_one_out),
        progress=asked.session.say,
    )
    with asked.answered("diagnosing", ask) as found:
        follows = asked.request(asked.model).with_options(found.next_command)
        result = replace(found, next_command=follows)
        asked.show(result, result.before.remarks)
        write_answer(asked.session, "diagnose", result, pages.diagnosis_page(result))


@with_question
def form(asked: Question) -> None:
    """Contact pressure and stiffness of the tire from its logs, with standard errors."""
    with asked.answered("fitting the form", api.answers.tire_form) as result:
        asked.show(result, [result.headline])
        write_answer(asked.session, "form", result)


@with_question
def ladder(
    asked: Question,
    save: Annotated[
        Path | None,
        typer.Option(
            "--save", help="Write the model at the top of the ladder.", callback=options.in_a_folder
        ),
    ] = None,
    propose: Annotated[
        bool,
        typer.Option(
            "--propose",
            help="Identify what is unknown, as `propose`, if the known effects end above the "
            "noise floor.",
        ),
    ] = False,
) -> None:
    """Forward selection: effects are added one by one until none is worth adding."""
    if save is not None:
        api.models.refuse_another(save)
    ask = partial(api.answers.ladder, propose=propose, progress=asked.session.say)
    with asked.answered("climbing", ask) as result:
        for step in pages.ladder_steps(result):
            asked.session.say(step)
        asked.show(result, result.remarks)
        if save is not None:
            api.models.save_model(result.model, save)
        write_answer(asked.session, "ladder", result)


@with_question
def propose(
    asked: Question,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="Write the model with the proposal; no file without a proposal.",
            callback=options.in_a_folder,
        ),
    ] = None,
    format: Annotated[
        str | None, typer.Option("--format", help="json in place of the page.")
    ] = None,
    always: Annotated[
        bool, typer.Option("--always", help="Search even if a known effect fits.")
    ] = False,
    shape: Annotated[
        bool, typer.Option("--shape", help="A measured shape in place of formulas.")
    ] = False,
) -> None:
    """Identify an unknown effect: formulas that remove it, or its measured shape."""
    if format not in (None, "json"):
        raise UsageError(
            f"--format {format}", allowed="json is allowed", do="give it, or leave it out"
        )
    if output is not None:
        api.models.refuse_another(output)
    ask = partial(api.answers.propose, always=always, shape=shape, progress=asked.session.say)
    with asked.answered("proposing", ask) as result:
        follows = ""
        if result.status != "nothing":
            asked.show(result, ())
            follows = asked.request(output or Path("BETTER.toml")).command("compare", model=True)
        elif unwritten := [str(path) for path in (output, asked.plot) if path is not None]:
            asked.session.note(f"{' and '.join(unwritten)} not written: there is no proposal")
        if output is not None and result.model is not None:
            api.models.save_model(result.model, output)
        if format == "json":
            write_json(result.to_json() | {"next_command": follows}, None)
        else:
            pages.print_answer(pages.proposal_page(result, follows))


# ---- `tirelog report LOG... -o report.html`.


def report(
    logs: Annotated[
        list[str] | None, typer.Argument(help="Logs or runs; '-' is standard input.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", help="The page to write, .html.", callback=options.in_a_folder
        ),
    ] = None,
    setup: options.SetupFile = None,
    table: Annotated[
        list[Path] | None, typer.Option("--table", help="A table already made; repeat for several.")
    ] = None,
    campaign: Annotated[
        Path | None, typer.Option("--campaign", help="A campaign's output folder.")
    ] = None,
    model: Annotated[
        Path | None, typer.Option("--model", help="Model file to compare with the logs.")
    ] = None,
    ladder: Annotated[Path | None, typer.Option("--ladder", help="The JSON of a `ladder`.")] = None,
    channel: options.ChannelName = None,
    effects: options.EffectsFile = None,
    quiet: options.Quiet = False,
) -> None:
    """One offline page: the logs, their tables, and where the model fails."""
    os.environ.setdefault(
        "ARROW_DEFAULT_MEMORY_POOL", "system"
    )  # the default one keeps what is freed: 50 MB for an hour's tables

    paths, tables = tuple(logs or ()), tuple(table or ())
    asked = api.answers.ReportRequest(
        paths, setup, model, ladder, campaign, tables, channel, effects
    )
    page = api.answers.report_page(asked, output)
    with Session(setup, quiet, hashed=True) as session:
        with session.working_on("making the page"):
            recordings = session.all_recordings(list(paths)) if paths else []
            written = api.answers.make_report(recordings, asked, page, session.say)
        session.note(*written)


# ---- `tirelog campaign run | status MANIFEST`.


Manifest = Annotated[Path, typer.Argument(help="The campaign's manifest (TOML).")]
Only = Annotated[
    str | None, typer.Option("--only", help="Only logs whose path or name matches this pattern.")
]


def run(
    manifest: Manifest,
    workers: Annotated[
        int, typer.Option("--workers", min=1, max=256, help="Processes on this machine.")
    ] = 1,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Print what would be made.")] = False,
    only: Only = None,
    retry_failed: Annotated[
        bool, typer.Option("--retry-failed", help="Try the failed logs again.")
    ] = False,
    quiet: options.Quiet = False,
) -> None:
    """Make all that is not made yet: every log's tables, then the models over all logs."""
    session = Session(quiet=quiet)
    if dry_run:
        for log in api.campaigns.campaign_status(
            manifest, only=only, retry_failed=retry_failed
        ).logs:
            if log.made:
                typer.echo(printable(f"{log.log}: {', '.join(log.made)}"))
        return
    done = api.campaigns.run_campaign(
        manifest,
        workers=workers,
        only=only,
        retry_failed=retry_failed,
        began=partial(campaign_progress, quiet),
        progress=session.note,
        during=session.working_on,
    )
    for loss in done.lost:
        say(f"note: {loss}")
    for error in done.failed:
        say(f"error: {error}")
    if done.failed or done.lost:
        raise typer.Exit(int(ExitStatus.INPUT_LOST))


def status(manifest: Manifest, quiet: options.Quiet = False) -> None:
    """Which logs are done, failed and open; also during a run."""
    found = api.campaigns.campaign_status(manifest)
    typer.echo(
        f"{found.name}: {len(found.logs)} logs, {found.count('done')} done, "
        f"{found.count('failed')} failed, {found.count('open')} open"
    )
    for log in found.logs:
        if log.state == "open":
            typer.echo(printable(f"open    {log.log}"))
        elif log.state == "failed":
            typer.echo(printable(f"failed  {log.error}"))
