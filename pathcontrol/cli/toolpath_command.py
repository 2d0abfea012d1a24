"""The command ``pathcontrol toolpath``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from pathcontrol._interrupts import delay_interrupt
from pathcontrol._suffixes import refuse_suffix
from pathcontrol.cli.files import check_file
from pathcontrol.cli.group import json_option
from pathcontrol.cli.quantity import QuantityType, check_feed


@click.command("toolpath")
@click.argument("file", type=click.Path(exists=False, path_type=Path))
@click.option("--unit", metavar="UNIT", help="Unit of length of a file that does not say: mm, in, …")
@click.option(
    "--layer", "layers", multiple=True, metavar="LAYER", help="A layer of a DXF or SVG file, or an id; repeat for more."
)
@click.option("--skip", multiple=True, metavar="KIND", help="Leave out text, image, point, …; repeat for more.")
@click.option(
    "--gap",
    type=QuantityType("m"),
    metavar="LENGTH",
    help="Join the ends of a DXF or SVG file that are so near, as '5 um', or a number in metres.",
)
@click.option("--ppi", type=float, help="Pixels per inch of an SVG file.  [default: 96]")
@click.option(
    "--feed",
    type=QuantityType("m/s"),
    metavar="SPEED",
    help="Feed of contours for which the file gives none, as '50 mm/s', or a number in m/s.",
)
@click.option(
    "--arc-tolerance",
    type=QuantityType("m"),
    metavar="LENGTH",
    help="How far arcs of G-code may be rounded, as '0.02 mm', or in metres.",
)
@click.option("--columns", metavar="NAMES", help="What the columns of a table are: x,y,z,nx,ny,nz or x=0,y=2,z=Height.")
@click.option("--decimal", metavar="MARK", help="The decimal mark in a table: . or ,")
@click.option(
    "--z",
    type=QuantityType("m"),
    metavar="LENGTH",
    help="Height of a table of x and y alone, as '5 mm', or in metres.",
)
@click.option(
    "--start",
    type=QuantityType("m"),
    nargs=3,
    metavar="X Y Z",
    help="Where a G-code program finds the tool, each as '10 mm', or a number in metres.",
)
@click.option(
    "--lenient", "unknown", flag_value="warn", help="Warn of what is not understood and cannot move the tool."
)
@click.option(
    "--plot", type=click.Path(dir_okay=False, path_type=Path), help="Draw it: writes this name as SVG and PNG."
)
@json_option
def command(file: Path, plot: Path | None, as_json: bool, **options: Any) -> None:
    """Show what is in a toolpath FILE: CSV, G-code, SVG or DXF."""
    check_file(file, "a toolpath")
    from pathcontrol.cli.tables import toolpath_tables
    from pathcontrol.toolpaths.read import read_toolpath
    from pathcontrol.toolpaths.summary import summary

    if plot is not None:
        refuse_suffix(plot, "a figure", ".svg", ".png", ".pdf", name="plot")
    given = {name: value for name, value in options.items() if value not in (None, ())}
    check_feed(options["feed"])
    read = read_toolpath(file, **given)
    content = summary(read)
    if plot is not None:
        with delay_interrupt():
            from pathcontrol.view.figures.style import save_figure
            from pathcontrol.view.figures.toolpath_figure import toolpath_figure
        content["figures"] = [str(path) for path in save_figure(toolpath_figure(read), plot)]
    if as_json:
        click.echo(json.dumps(content))
        return
    from rich.console import Console
    from rich.text import Text

    console = Console()
    for part in toolpath_tables(content, console.width):
        console.print(part)
    for name in content.get("figures", []):
        console.print(Text(f"  figure: {name}"))
