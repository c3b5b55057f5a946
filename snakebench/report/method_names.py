"""What the pages call methods: policies, and fixed gaits by their search space or study."""

from snakebench.store import EXTENDED, FASTER, PAPER, STRONGER

METHOD_NAMES = {
    "sea_snake": "sea snake",
    PAPER: "sinusoid",
    FASTER: "faster sinusoid",
    STRONGER: "stronger sinusoid",
    EXTENDED: "wider sinusoid",
    "fourier": "free waveform",
}


def name_of(method: str) -> str:
    """The name of a policy or of the fixed gaits of a search space."""
    return METHOD_NAMES.get(method, method).replace("_", " ")
