"""`snakebench play`: the page in which the robot swims live."""

import webbrowser
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from snakebench.cli.printing import say
from snakebench.cli.study import REPORTS, RESULTS, Results
from snakebench.errors import InvalidValue
from snakebench.files import check_outputs, writable_directory, write_file


def play(
    *,
    results: Results = RESULTS,
    out: Annotated[Path, Parameter(help="The page to write, an HTML file.")] = REPORTS / "play.html",
    open: Annotated[bool, Parameter(help="Open the page in the browser.")] = True,
) -> None:
    """Open a page in which the robot swims live: drag the viscosity, race two controllers, switch off a joint.

    The page is one file that needs no network. It has the published policies and gaits of the results.

    Example: snakebench play --out play.html --no-open
    """
    from snakebench.play.page import play_page

    if not results.is_dir():
        raise InvalidValue(f"{results} holds no results: give --results of a clone of the repository")
    if out == REPORTS / "play.html":
        writable_directory(REPORTS)
    check_outputs([out], results.glob("[!.]*/**/*"))
    write_file(out, play_page(results, say))
    say(f"page: {out}")
    if open and not webbrowser.open(out.resolve().as_uri()):
        say("no browser was found: open the page yourself")
