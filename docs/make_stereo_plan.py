"""Makes docs/stereo-plan.png, the example of docs/stereo.md, and prints its plans: python docs/make_stereo_plan.py.

A relief on a south wall in Bregenz, under skies that the project models: the picture needs no data of others.
"""

from datetime import date
from pathlib import Path

import click

from lighting.files import encode_png
from lighting.stereo import ModelledSkies, Plan, Question, clock, conditions, draw_plan, plan_photos, shown_error, title

PICTURE = Path(__file__).with_name("stereo-plan.png")
WALL = Question(facing=180.0)
DAYS = (date(2026, 3, 20), date(2026, 6, 21), date(2026, 12, 21))


def wall(day: date, sky: str) -> tuple[ModelledSkies, Plan]:
    skies = ModelledSkies(47.5, 9.75, day, day, sky)  # type: ignore[arg-type]
    return skies, plan_photos(skies, WALL)


def main() -> None:
    for day in DAYS:
        for sky in ("clear", "mixed"):
            skies, plan = wall(day, sky)
            best = ", ".join(
                f"{w.hours} h {clock(w.start)} to {clock(w.end)} {shown_error(w.error)} (gain {w.gain:.0f})"
                for w in plan.windows
            )
            click.echo(f"{title(skies, plan)}: {best}")
            if (day, sky) == (DAYS[1], "clear"):
                drawing = draw_plan(plan, f"When to photograph: {title(skies, plan)}", conditions(skies, WALL))
                PICTURE.write_bytes(encode_png(drawing))


if __name__ == "__main__":
    main()
