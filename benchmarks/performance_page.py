"""The words and tables of docs/growth.md, from measured figures."""

from typing import Any

SIZE = (1600, 1200)  # of the photos that are counted and sent, pixels


def page(figures: dict[str, Any]) -> str:
    """The document: tables, what they say, and the plot."""
    parts = [
        "# How cost grows\n",
        "Made by `python -m benchmarks.performance`; the photos are JPEGs of "
        f"{SIZE[0]} x {SIZE[1]} pixels, and each part names the machine that it was measured on.\n",
        "![Time by photos, time by map height, answers by clients](growth.png)\n",
        photos_page(figures["photos"]) if "photos" in figures else "## Photos\n\nNot measured yet.\n",
        heights_page(figures["heights"]) if "heights" in figures else "## Map height\n\nNot measured yet.\n",
        clients_page(figures["clients"]) if "clients" in figures else "## Clients\n\nNot measured yet.\n",
    ]
    return "\n".join(parts)


def line_through(figures: dict[str, Any]) -> tuple[float, float]:
    """Seconds to start and seconds a photo: the line through the least and the greatest batch."""
    counts = sorted(map(int, figures["seconds"]))
    low, high = (figures["seconds"][str(count)] for count in (counts[0], counts[-1]))
    each = (high - low) / (counts[-1] - counts[0])
    return max(low - each * counts[0], 0.0), each


def photos_page(figures: dict[str, Any]) -> str:
    start, each = line_through(figures)
    rows = [
        f"| {int(n):,} | {t:.1f} | {int(n) / t:.1f} |"
        for n, t in sorted(figures["seconds"].items(), key=lambda item: int(item[0]))
    ]
    hours, cpus = 1e6 * each / 3600, figures["cpus"]
    return f"""## Photos

`lighting batch`, one process per CPU; {figures["machine"]}.

| photos | seconds | photos per second |
| ---: | ---: | ---: |
{chr(10).join(rows)}

The time is about linear: {1000 * each:.1f} ms per photo plus {start:.1f} s for the start (imports, and loading the
network in every process), by the line through the smallest and the largest batch. The start is more than a tenth of
the whole below {max(1, round(9 * start / each)):,} photos. The cost per photo does not grow with the number already
done: the journal is only appended to, and only the names of finished photos are kept in memory. More processes than
CPUs gain nothing.

**One million photos** of this size take {hours:.1f} hours on this machine ({hours * cpus:.0f} CPU-hours), and their
`lighting.jsonl` {figures["line"] * 1e6 / 1e9:.1f} GB. Larger photos take longer to decode: Pillow must read the whole
JPEG, at whatever scale it decodes it.
"""


def heights_page(figures: dict[str, Any]) -> str:
    rows = []
    for height in map(int, figures["render"]):
        render_ms, write_ms, size = (figures[name][str(height)] for name in ("render", "write", "size"))
        pixels = 2 * height * height
        rows.append(
            f"| {height} | {render_ms:.1f} | {1e6 * render_ms / pixels:.1f} "
            f"| {100 * figures['system'][str(height)]:.0f} % "
            f"| {write_ms:.1f} | {1e6 * write_ms / pixels:.1f} | {size / 1e6:.2f} |"
        )
    return f"""## Map height

{figures["machine"]}.

| height | render, ms | ns per pixel | system time | write EXR, ms | ns per pixel | EXR, MB |
| ---: | ---: | ---: | ---: | ---: | ---: | ---: |
{chr(10).join(rows)}

In small maps the fixed work dominates: the table of the sky around the sun, the integral of the sky for the ground and
the grid over the sun's disc take the same time at every height, so the time per pixel falls as maps grow. In the
largest maps memory dominates: a map of height 4096 is an array of {4096 * 8192 * 12 / 1e6:.0f} MB, which the operating
system clears before the process gets it; "system time" is the operating system's share of the rendering time. Writing
is mostly compression and grows with the number of pixels. With `--envmap`, a million maps of height 512 fill
{figures["size"]["512"] * 1e6 / 1e12:.1f} TB, and their rendering and writing come on top.
"""


def clients_page(figures: dict[str, Any]) -> str:
    rows = [
        f"| {n} | {f['rate']:.1f} | {f['median']:.0f} | {f['p95']:.0f} | {100 * f['refused']:.0f} % |"
        for n, f in figures["load"].items()
    ]
    return f"""## Clients

`POST /v1/lighting` to one service process. Each client sends its next request as soon as it has its answer; the clients
run on the same machine as the service; {figures["machine"]}.

| clients | answers per second | median, ms | 95 %, ms | turned away |
| ---: | ---: | ---: | ---: | ---: |
{chr(10).join(rows)}

The rate grows with the clients until every CPU is busy, then stays; from there on each further client only adds
waiting time. When the queue is full, the service refuses requests immediately (503 with `Retry-After`) instead of
letting all wait.
"""
