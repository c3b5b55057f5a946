"""The page of the study of the limit."""

from typing import Any

from snakebench.studies.published import Published


def page(study: Published) -> dict[str, Any]:
    """What the page shows."""
    return {"findings": {}}
