"""Reading and checking a URDF, before Pinocchio sees it.

The text becomes an element (:mod:`.parse`), whose form is checked (:mod:`.form`), then its values
(:mod:`.values`, :mod:`.inertia`) and what it looks like (:mod:`.shapes`); :mod:`.check` does all in order.
"""

from pathcontrol.robot.urdf.check import check_urdf
from pathcontrol.robot.urdf.checks.finding import Finding, UrdfReport
from pathcontrol.robot.urdf.xml.parse import parse_urdf

__all__ = ["Finding", "UrdfReport", "check_urdf", "parse_urdf"]
