"""What all figures share: colours, the theme, and how a figure and the data that it draws become a part of a page."""

import base64
import gzip
import hashlib
import io
import re
import warnings
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import matplotlib

matplotlib.use("svg")

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import seaborn as sns
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from snakebench.errors import visible
from snakebench.fluid import PAPERS
from snakebench.names import INTEGRATED
from snakebench.report.figure_axes import lay_out
from snakebench.value import FloatArray

Color = str | tuple[float, float, float]


class Look(NamedTuple):
    """How something is drawn in every figure."""

    color: str
    marker: str = "."
    line: str = "-"


ENGINE_COLORS = defaultdict(lambda: "#6a3d9a", {"pybullet": "#c2410c", "planar": "#0b6e99"})
METHOD_LOOKS = {  # a method has one colour and one marker everywhere
    "sea snake": Look("#b58900", "*"),
    "sinusoid": Look("#8a949e", "s"),
    "faster sinusoid": Look("#64707b", "p"),
    "stronger sinusoid": Look("#b7bec5", "H"),
    "wider sinusoid": Look("#3d4650", "D"),
    "free waveform": Look("#6a3d9a", "^"),
    "one waveform for all": Look("#b89bd0", "v"),
    "limit": Look("#111111", "|", "--"),
    "symmetric": Look("#c2410c", "X"),
    "teacher": Look("#2b5fd9", "P"),
    "student": Look("#2a9d57", "o"),
    "asymmetric_critic": Look("#b279a2", ">"),
    "memoryless_teacher": Look("#12867a", "<"),
    "imitator": Look("#e377c2", "d"),
    "imitator_positive": Look("#9c1f6e", "h"),
    "schedule": Look("#8faa1c", "8"),
    "schedule_positive": Look("#4d6b00", "+"),
}
_FLUID_LOOKS = Look("#4aa3c7", line="-"), Look("#d98c00", line="--"), Look("#8c3b12", line=":")
FLUIDS = dict(zip(PAPERS, _FLUID_LOOKS, strict=True))  # the colours are for figures that compare no methods
_OTHERS = ("-.", (0, (5, 1)), (0, (1, 1)), (0, (3, 1, 1, 1)))  # lines of other fluids
_SAMPLERS = {"tpe": "#c2410c", "random": "#7a8591", "cmaes": "#2a9d57", "gp": "#2b5fd9"}
_PALER = {"teacher_short": "#9db7f2", "symmetric_short": "#efae8d"}  # learned from short rollouts
COLORS: dict[str, Color] = {"mean": "#444444", INTEGRATED: "#444444", **_SAMPLERS, **_PALER}
COLORS |= {name: look.color for name, look in (METHOD_LOOKS | FLUIDS).items()}
_LONGEST_NAME = 100  # characters of a file
_FONTS = 'font-family="Arial, DejaVu Sans, Liberation Sans, Bitstream Vera Sans, sans-serif"'
_DOTS = 100  # to an inch, of thousands of markers, which are drawn as a raster

sns.set_theme(
    style="whitegrid",
    context="paper",
    font_scale=1.15,
    rc={
        "svg.fonttype": "none",
        "path.simplify_threshold": 0.4,  # pixels by which a line of many points may differ: it is a third shorter
        "svg.hashsalt": "snakebench",
        "font.family": "sans-serif",
        "axes.titleweight": "bold",
        "axes.titley": 1.0,  # fixed: to look for a free place is slow
        "text.parse_math": False,  # a name with dollars is a name, and no formula
    },
)


def method_look(name: str) -> Look:
    """The look of a method, or that of what is compared for once."""
    return METHOD_LOOKS.get(name, Look("#c2557a", "h"))


def fluid_lines(names: Sequence[str]) -> dict[str, Any]:
    """The line style of each fluid, the same in every figure for those that are in `FLUIDS`."""
    spare = iter(_OTHERS * len(names))
    return {name: FLUIDS[name].line if name in FLUIDS else next(spare) for name in names}


def palette(names: Sequence[str], others: str = "deep") -> dict[str, Color]:
    """A colour for each name, the same in every figure for those in `COLORS`; others have one of a palette."""
    spare = iter(sns.color_palette(others, len(names)))
    return {name: COLORS.get(name) or next(spare) for name in names}


def svg(figure: Figure, title: str) -> Markup:
    """The figure as an SVG element that scales with the page, and its data to save; equal figures are equal bytes.

    Names in the title and in the figure may be any text: nothing in them is markup, a formula or an id.
    """
    title = visible(title)
    own = f"f{hashlib.sha256(title.encode()).hexdigest()[:8]}"  # ids are the page's, and figures share glyphs and clips
    data = packed(drawn_points(figure).encode(errors="backslashreplace"))
    text = io.StringIO()
    # A name may have signs that matplotlib's fonts lack, or be too long for its picture.
    with warnings.catch_warnings(action="ignore", category=UserWarning):
        region = lay_out(figure)
        figure.savefig(text, format="svg", bbox_inches=region, dpi=_DOTS, metadata={"Date": None})
    plt.close(figure)
    whole = visible(text.getvalue()[text.getvalue().index("<svg") :])
    bare = re.sub(r">\s+<", "><", re.sub(r"<metadata>.*?</metadata>", "", whole, flags=re.DOTALL))
    used = dict.fromkeys(re.findall(r'(?:href="|url\()#([^")]+)', bare))
    ids = {name: f"{own}-{k}" for k, name in enumerate(used)}
    tags = _unwrapped(_with_classes(re.sub(r"<[^<>]*>", lambda tag: _adapted(tag[0], ids), bare), own))
    scaled = re.sub(r'(width|height)="[\d.]+pt" ?', "", tags, count=2)
    head, _, body = scaled.replace("<svg", f'<svg class="figure" id="{own}" {_FONTS}', 1).partition(">")
    label = Markup(' role="img" aria-label="{}">').format(title)
    file = re.sub(r"\W+", "-", title.lower())[:_LONGEST_NAME]
    link = Markup('<a class="data" download="{}.csv.gz" href="{}">Data (CSV)</a>').format(file, data)
    return Markup(head) + label + Markup(body) + link  # matplotlib escapes what it writes


def _adapted(tag: str, ids: Mapping[str, str]) -> str:
    """A tag of a figure with fewer digits, more of them in a small round marker, no font, and ids of the page's own."""
    digits = 2 if "\nC " in tag else 1
    tag = re.sub(r' (x|y)="([^"]*)"', lambda place: f' {place[1]}="{float(place[2]):.{digits}f}"', tag)
    tag = re.sub(r' d="([^"]*)"', lambda path: f' d="{_relative(path[1], digits)}"', tag)
    tag = re.sub(r' id="([^"]*)"', lambda name: name[0] if name[1] in ids else "", tag)
    tag = re.sub(r" font-family: [^;\"]*;| transform=\"rotate\(-?0 [^\"]*\"", "", tag)
    return re.sub(r'(\bid="|href="#|url\(#)([^")]*)', lambda place: place[1] + ids[place[2]], tag)


def _relative(path: str, digits: int) -> str:
    """A path whose points, after a first one, are steps from the one before, rounded such that no error adds up."""
    parts, here, before = list[str](), np.zeros(2, int), ""
    for command, numbers in re.findall(r"([A-Za-z])([^A-Za-z]*)", path):
        points = np.rint(10**digits * np.array(numbers.split(), float)).astype(int).reshape(-1, 2)
        name, steps = (command, points) if command == "M" else (command.lower(), points - here)
        if name == "l" and len(points) == 1 and not steps.all():  # along an axis
            name, steps = ("v", steps[:, 1]) if steps[0, 1] else ("h", steps[:, 0])
        written = " ".join(f"{step / 10**digits:g}" for step in steps.ravel())
        parts.append(f" {written}" if name == before != "M" else f"{name}{written}")
        here, before = points[-1] if len(points) else here, name
    return re.sub(r" (?=-)", "", re.sub(r"\b0\.", ".", "".join(parts)))


def _with_classes(figure: str, own: str) -> str:
    """A figure in which styles and clips that several tags share are classes, which hold in this figure only."""
    attribute = re.compile(r' (?:style|(clip-path))="([^"]*)"')
    shared = Counter(attribute.findall(figure))
    classes = {look: f"c{k}" for k, (look, n) in enumerate(shared.items()) if n > 2}
    rules = "".join(f"#{own} .{name}{{{f'{clip}:' if clip else ''}{value}}}" for (clip, value), name in classes.items())

    def classed(tag: re.Match[str]) -> str:
        names = [classes[look] for look in attribute.findall(tag[0]) if look in classes]
        others = attribute.sub(lambda one: "" if one.groups("") in classes else one[0], tag[0])
        return re.sub(r"^<\w+", lambda start: f'{start[0]} class="{" ".join(names)}"', others) if names else others

    return re.sub(r"<[^<>]*>", classed, figure).replace("</style>", f"{rules}</style>", 1)


def _unwrapped(figure: str) -> str:
    """A figure without groups that have no attributes."""
    kept = list[bool]()

    def tag(found: re.Match[str]) -> str:
        if found[0] != "</g>":
            kept.append(found[0] != "<g>")
            return found[0] if kept[-1] else ""
        return found[0] if kept.pop() else ""

    return re.sub(r"<g(?: [^<>]*[^<>/])?>|</g>", tag, figure)


def drawn_points(figure: Figure) -> str:
    """Every line, marker, band, bar and cell of a figure as CSV: panel, series, x, y, and the value of a cell.

    Points of lines and markers beyond the axes, which nobody sees, are left out.
    """
    rows = [
        {"panel": panel, "series": name} | dict(zip(("x", "y", "value"), point, strict=False))
        for ax in figure.axes
        for panel, name, points in _series(ax)
        for point in np.asarray(points, float).tolist()
    ]
    return pd.DataFrame(rows).to_csv(index=False, lineterminator="\n", float_format="%.4g") if rows else ""


def _series(ax: Axes) -> Iterator[tuple[str, str, Any]]:
    """Panel, name and points of every series of a panel."""

    def named(artist: Any) -> str:
        return str(artist.get_label()).lstrip("_")  # which is in no legend

    panel = " / ".join(filter(None, (ax.get_title().replace("\n", " "), ax.get_ylabel(), ax.get_xlabel())))
    for line in ax.get_lines():
        yield panel, named(line), _seen(ax, line.get_xydata())
    for collection in ax.collections:
        if isinstance(collection, PathCollection):
            yield panel, named(collection), _seen(ax, collection.get_offsets())
        else:
            for path in collection.get_paths():
                yield panel, f"{named(collection)} (outline)", path.vertices
    bars = [bar for bar in ax.patches if isinstance(bar, Rectangle) and bar.get_width() and bar.get_height()]
    ends = [(bar.get_x() + bar.get_width(), bar.get_y() + bar.get_height() / 2) for bar in bars]
    yield panel, "bars (end, middle)", ends
    for image in ax.get_images():
        cells = np.ma.getdata(np.asarray(image.get_array()))
        yield panel, "cells", [(j, i, value) for (i, j), value in np.ndenumerate(cells)] if cells.ndim == 2 else []


def _seen(ax: Axes, points: Any) -> FloatArray:
    """The points within the axes, and those next to them in a line; all of a line of two.

    Of longer lines, a segment that crosses the axes between two points outside is not kept.
    """
    all_points = np.asarray(points, float)
    low, high = np.sort([ax.get_xlim(), ax.get_ylim()]).T
    inside = np.pad(((low <= all_points) & (all_points <= high)).all(axis=1), 1)
    near = inside[:-2] | inside[1:-1] | inside[2:]
    return all_points[near] if len(all_points) > 2 else all_points


def packed(content: bytes) -> str:
    """A file as a link that holds it, gzipped; pages unpack it as they save it, and equal files are equal links."""
    return f"data:application/gzip;base64,{base64.b64encode(gzip.compress(content, mtime=0)).decode()}"
