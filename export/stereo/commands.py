"""`python -m export stereo ...`: what outdoor photometric stereo promises and keeps."""

import click


@click.group()
def stereo() -> None:
    """Outdoor photometric stereo: its noise, its normals, its network."""


@stereo.command()
def gain() -> None:
    """Print what the noise gain predicts beside what simulated noise does; a minute or two on two cores."""
    from export.stereo.gain import report

    report(click.echo)
