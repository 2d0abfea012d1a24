"""All figures of runs, sweeps, tunings and toolpaths, and how they are saved; in :mod:`pathcontrol` as well."""

from pathcontrol.view.figures.comparison import comparison_figure as comparison_figure
from pathcontrol.view.figures.deviation import deviation_figure as deviation_figure
from pathcontrol.view.figures.errors import error_bands_figure as error_bands_figure
from pathcontrol.view.figures.errors import error_figure as error_figure
from pathcontrol.view.figures.pareto import pareto_figure as pareto_figure
from pathcontrol.view.figures.path import path_figure as path_figure
from pathcontrol.view.figures.path import phase_figure as phase_figure
from pathcontrol.view.figures.shares import limits_figure as limits_figure
from pathcontrol.view.figures.speed import speed_figure as speed_figure
from pathcontrol.view.figures.style import save_figure as save_figure
from pathcontrol.view.figures.sweep import basin_figure as basin_figure
from pathcontrol.view.figures.sweep import robustness_figure as robustness_figure
from pathcontrol.view.figures.tool import tool_figure as tool_figure
from pathcontrol.view.figures.toolpath import toolpath_figure as toolpath_figure
from pathcontrol.view.figures.torque import torque_figure as torque_figure
