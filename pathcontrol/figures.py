"""All figures of runs, sweeps, tunings and toolpaths, and how they are saved; in :mod:`pathcontrol` as well."""

from pathcontrol.view.figures.attraction_figure import attraction_figure as attraction_figure
from pathcontrol.view.figures.ballbar_figure import ballbar_figure as ballbar_figure
from pathcontrol.view.figures.comparison_figure import comparison_figure as comparison_figure
from pathcontrol.view.figures.deviation_figure import deviation_figure as deviation_figure
from pathcontrol.view.figures.error_figures import error_bands_figure as error_bands_figure
from pathcontrol.view.figures.error_figures import error_figure as error_figure
from pathcontrol.view.figures.friction_figure import friction_figure as friction_figure
from pathcontrol.view.figures.limits_figure import limits_figure as limits_figure
from pathcontrol.view.figures.observer_figure import observer_figure as observer_figure
from pathcontrol.view.figures.pareto_figure import pareto_figure as pareto_figure
from pathcontrol.view.figures.path_figures import path_figure as path_figure
from pathcontrol.view.figures.path_figures import phase_figure as phase_figure
from pathcontrol.view.figures.power_balance_figure import power_balance_figure as power_balance_figure
from pathcontrol.view.figures.reach_figure import reach_figure as reach_figure
from pathcontrol.view.figures.scenario_figure import scenario_figure as scenario_figure
from pathcontrol.view.figures.speed_figure import speed_figure as speed_figure
from pathcontrol.view.figures.stability_figure import stability_figure as stability_figure
from pathcontrol.view.figures.style import save_figure as save_figure
from pathcontrol.view.figures.sweep_figures import basin_figure as basin_figure
from pathcontrol.view.figures.sweep_figures import robustness_figure as robustness_figure
from pathcontrol.view.figures.tool_figure import tool_figure as tool_figure
from pathcontrol.view.figures.toolpath_figure import toolpath_figure as toolpath_figure
from pathcontrol.view.figures.torque_figure import torque_figure as torque_figure
