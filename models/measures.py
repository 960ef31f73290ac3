"""A model's numbers in a spec: blocks of constants that the build fills in.

A block stands between two comment lines and is a `constants:` section of its own; whoever writes the spec lists the
names that it needs, and the build writes their values and meanings::

    # measures of luxo, from `python -m stc.models.build`
    constants:
      m3 = 0.6,                       # kg, of the head
      d3 = 0.07155771905424202;       # m, from the neck to the head's centre of mass
    # end of measures
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from stc.errors import StcError
from stc.models.description import Measure
from stc.models.mjcf import number

_BLOCK = re.compile(
    r"^# measures of (?P<model>\w+)[^\n]*\n(?P<body>.*?)^# end of measures *$", re.MULTILINE | re.DOTALL
)
_OPENING = re.compile(r"^# measures of .*$", re.MULTILINE)
_ENTRY = re.compile(r"(\w+)\s*(?:=[^,;]*)?[,;]")


class MeasureError(StcError):
    """A spec's block of measures cannot be filled in."""


def table(model: str, measures: Mapping[str, Measure], names: Iterable[str] | None = None) -> str:
    """A whole block with these names (default: all), in the model's order."""
    wanted = set(measures if names is None else names)
    chosen = [(name, measure) for name, measure in measures.items() if name in wanted]
    lines = [f"# measures of {model}, from `python -m stc.models.build`", "constants:"]
    for index, (name, measure) in enumerate(chosen):
        mark = ";" if index == len(chosen) - 1 else ","
        meaning = ", ".join(part for part in (measure.unit, measure.meaning) if part)
        lines.append(f"{f'  {name} = {number(measure.value)}{mark}':<32}# {meaning}")
    return "\n".join([*lines, "# end of measures", ""])


def rewrite(text: str, models: Mapping[str, Mapping[str, Measure]], file: str) -> str:
    """A spec's text with every block of measures filled in anew; without blocks the same text.

    Raises:
        MeasureError: an unknown model, an unknown name, an empty block, or one without its last line.
    """

    def fill(block: re.Match[str]) -> str:
        model = block["model"]
        if model not in models:
            raise MeasureError(f"{file}: no described model {model}; there are {', '.join(models)}")
        body = "\n".join(line.split("#")[0] for line in block["body"].splitlines())
        names = _ENTRY.findall(body.replace("constants:", ""))
        unknown = [name for name in names if name not in models[model]]
        if unknown or not names:
            asked = f"has no {unknown[0]}" if unknown else "is asked for nothing"
            raise MeasureError(
                f"{file}: the model {model} {asked}; its measures are {', '.join(models[model])}"
            )
        return table(model, models[model], names).removesuffix("\n")

    filled, count = _BLOCK.subn(fill, text)
    if count != len(_OPENING.findall(text)):
        raise MeasureError(f"{file}: a block of measures needs the line `# end of measures` after it")
    return filled
