"""The control loop: the law's torques within the envelope, and one reaction to each fault."""

import warnings

import numpy as np
import pytest
from simulated_arm import BAD, WIDE, H, Simulated, law_of

import pathcontrol as pc
from pathcontrol.errors import InputError
from pathcontrol.hardware.control_loop import ControlLoop, Mode
from pathcontrol.hardware.envelope import Envelope

GANTRY = """<robot name="gantry"><link name="base"/>
<link name="slide"><inertial><mass value="8"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="arm"><inertial><origin xyz="0.1 0 0"/><mass value="3"/>
<inertia ixx="0.02" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="lift" type="prismatic"><parent link="base"/><child link="slide"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" velocity="1" effort="300"/></joint>
<joint name="turn" type="revolute"><parent link="slide"/><child link="arm"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" velocity="5" effort="30"/></joint></robot>"""

LAWS = [pc.ComputedTorque, pc.ExtendedMotionPlan, pc.Projection]


def run_of(law, duration=0.3, push=None, **sensors):
    loop = pc.SampledLoop(period=H, **sensors)
    start = law.task.q_d(np.array(law.task.s0))
    return pc.simulate(law, start, duration=duration, loop=loop, disturbance=push, progress=False)


# --- within the envelope ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("n", "kind"), [*((2, kind) for kind in LAWS), (6, pc.ExtendedMotionPlan), (7, pc.Projection)])
def test_measurements_of_a_run_give_its_torques_to_the_last_bit(n, kind):
    law = law_of(n, kind)
    run = run_of(law, encoders=np.full(n, 2.0**20), velocity="difference", filter_hz=50.0)
    assert run.config["engine"] == "compiled"
    loop = ControlLoop(law, H, Envelope(**WIDE))
    q, qd, tau = (run.array(name)[0] for name in ("q_measured", "qd_measured", "tau_demand"))
    loop.start(run.array("q")[0, 0], run.array("qd")[0, 0])
    for k, t in enumerate(run.time):
        assert (loop.step(q[k], qd[k], t) == tau[k]).all(), k
    status = loop.status
    assert (status.mode, status.reason, status.ticks, status.saturated) == (Mode.RUN, "", len(run.time), False)
    assert status.faults == {}


def test_the_state_of_a_loop_is_that_of_the_law_held_or_not():
    law = law_of(2)
    for own in (law, pc.SpeedOverride(law), law.watching(), pc.EventPlan(law, threshold=50.0)):
        arm, loop = Simulated(own), ControlLoop(own, H, Envelope(**WIDE))
        for hold in (False, True):
            arm.drive(loop, 3)
            assert loop.state.shape == own.start(np.zeros(2), np.zeros(2)).shape
            assert loop.state[0] == loop.status.s
            if hold:
                loop.hold()


def test_what_pushes_the_arm_is_seen_in_the_loop():
    plain = law_of(2)
    law = pc.Projection(plain.robot.with_friction(None), plain.task, k_p=400.0, K_v=40.0).watching()
    push = np.array([3.0, 1.0])
    run = run_of(law, 0.1, pc.Push(push))
    loop = ControlLoop(law, H, Envelope(**WIDE))
    loop.start(run.array("q")[0, 0])
    for q, qd, t in zip(run.array("q")[0], run.array("qd")[0], run.time, strict=True):
        loop.step(q, qd, t)
    np.testing.assert_allclose(law.observed_torque(loop.state), push, rtol=0, atol=0.01)


@pytest.mark.parametrize("kind", LAWS)
def test_a_law_that_was_held_and_resumed_is_the_compiled_one_again(kind):
    law = law_of(2, kind)
    arm = Simulated(law)
    loop = ControlLoop(law, H, Envelope(**WIDE))
    arm.drive(loop, 100)
    loop.hold()
    held = arm.drive(loop, 300)[-50:]
    assert loop.status.mode == Mode.HOLD
    assert np.abs(np.diff(held["q"], axis=0)).max() < 1e-5
    s = loop.status.s
    loop.resume()
    gone = arm.drive(loop, 700)
    assert loop._plan._tick is loop._plan._free
    assert loop.status.mode == Mode.RUN
    assert loop.status.s > s
    steps = np.abs(np.diff(gone["tau"], axis=0)).max()
    assert steps < 20.0  # no jump, neither on resuming nor when the compiled law takes over


def test_a_loop_and_the_buttons_of_its_law_hold_the_plan_beside_each_other():
    law = pc.SpeedOverride(law_of(2))
    arm, loop = Simulated(law), ControlLoop(law, H, Envelope(**WIDE))

    def passed():
        s = loop.status.s
        arm.drive(loop, 100)
        return loop.status.s - s

    law.hold()
    loop.start(arm.q[0])
    assert passed() == 0  # a start is no resume
    law.reverse()
    assert passed() < 0
    loop.hold()
    arm.drive(loop, 400)
    for press in (law.hold, law.resume, law.reverse):
        press()
        assert abs(passed()) < 1e-9  # a reaction lasts until the loop goes on
    loop.resume()
    assert passed() < 0  # as the operator asked last
    law.resume()
    loop.hold()
    assert "held" not in law.describe()
    assert run_of(law).array("s")[0, -1] > 0  # the loop's hold is not that of others


# --- one fault each ------------------------------------------------------------------------------------------------


def started(n=2, **options):
    law = law_of(n)
    arm, loop = Simulated(law), ControlLoop(law, H, Envelope(**options))
    loop.start(arm.q[0], arm.qd[0])
    arm.drive(loop, 100)
    assert loop.status.mode == Mode.RUN
    return arm, loop


@pytest.mark.parametrize("what", BAD)
def test_a_few_bad_measurements_are_bridged_and_many_end_in_gravity_then_damping(what):
    arm, loop = started(patience=4)
    last = arm.drive(loop, 1)["tau"][-1]
    bridged = arm.drive(loop, 4, lambda k, *measured: BAD[what](*measured))
    assert loop.status.mode == Mode.RUN
    assert (bridged["tau"] == last).all()
    arm.drive(loop, 20)
    assert loop.status.mode == Mode.RUN
    arm.drive(loop, 6, lambda k, *measured: BAD[what](*measured))
    assert loop.status.mode == Mode.GRAVITY
    assert loop.status.reason
    assert loop.status.faults["measurement"] == 10
    arm.drive(loop, 50)
    assert loop.status.mode == Mode.DAMP
    assert np.abs(arm.qd).max() < 1e-2


def test_frozen_measurements_of_a_moving_arm_are_bad():
    arm, loop = started(frozen=10, patience=3)
    q, qd = arm.q[0].copy(), arm.qd[0].copy()
    arm.drive(loop, 9, lambda k, _q, _qd, t: (q, qd, t))
    assert loop.status.mode == Mode.RUN
    arm.drive(loop, 8, lambda k, _q, _qd, t: (q, qd, t))
    assert loop.status.mode == Mode.GRAVITY
    assert "equal measurements" in loop.status.reason


def test_a_missed_deadline_is_counted_and_a_long_gap_holds_the_plan():
    arm, loop = started(late=1.5, lost=5.0)
    arm.t += 2 * H
    arm.drive(loop, 1)
    assert (loop.status.mode, loop.status.faults["deadline"]) == (Mode.RUN, 1)
    arm.t += 10 * H
    arm.drive(loop, 400)
    assert loop.status.mode == Mode.HOLD
    assert "no step for" in loop.status.reason
    assert np.abs(arm.qd).max() < 1e-2


def test_a_joint_that_is_too_fast_is_damped():
    arm, loop = started()
    arm.qd = arm.qd + 1.2 * loop.envelope.velocity
    arm.drive(loop, 1)
    assert loop.status.mode == Mode.DAMP
    assert "its limit is" in loop.status.reason
    speeds = np.abs(arm.drive(loop, 500)["qd"]).max(-1)
    assert speeds[-1] < 1e-2


def test_a_joint_that_cannot_be_braked_before_its_limit_is_damped_and_stops_there():
    law = law_of(2)
    upper = law.task.q_d(np.linspace(0, 6, 200)).max(0) + 0.5
    arm, loop = Simulated(law), ControlLoop(law, H, Envelope(upper=upper, velocity=4.0, deceleration=20.0))
    loop.start(arm.q[0], arm.qd[0])
    arm.q, arm.qd = np.array([upper - [0.35, 0.6]]), np.array([[3.9, 0.0]])
    loop.start(arm.q[0], arm.qd[0])
    arm.drive(loop, 1)
    assert loop.status.mode == Mode.DAMP
    assert "cannot be braked" in loop.status.reason


@pytest.mark.parametrize(("away", "mode"), [(0.7, Mode.HOLD), (1.5, Mode.DAMP)])
def test_an_arm_that_leaves_the_tube_is_held_or_damped(away, mode):
    law = law_of(2, pc.ExtendedMotionPlan)
    arm, loop = Simulated(law), ControlLoop(law, H, Envelope(tube=0.5, jump=10.0))
    loop.start(arm.q[0], arm.qd[0])
    arm.drive(loop, 50)
    middle = np.array([0.2, 0.4])
    out = (arm.q[0] - middle) / np.linalg.norm(arm.q[0] - middle)
    arm.q = arm.q + away * out
    arm.drive(loop, 1)
    assert loop.status.mode == mode
    assert "from its path" in loop.status.reason


def test_a_start_off_the_path_within_the_tube_runs():
    law = law_of(2)
    arm, loop = Simulated(law), ControlLoop(law, H, Envelope(tube=0.6))
    arm.q = arm.q + 0.4
    loop.start(arm.q[0], arm.qd[0])
    arm.drive(loop, 500)
    assert loop.status.mode == Mode.RUN


AFAR = {
    "elsewhere": (lambda q: q + np.array([0, 0, 0, 0, 2.09, 0]), "bring it there, or widen tube"),
    "joints reversed": (lambda q: q[::-1], "bring it there, or widen tube"),
    "degrees": (np.rad2deg, "did you mean degrees?"),
    "beyond a limit": (lambda q: q + np.array([0, 0, 2.0, 0, 0, 0]), "outside its limits"),
}


@pytest.mark.parametrize(
    ("where", "kind"), [*(("elsewhere", kind) for kind in LAWS), *((where, pc.Projection) for where in list(AFAR)[1:])]
)
def test_an_arm_that_starts_far_from_its_path_is_damped_and_says_why(where, kind):
    law = law_of(6, kind)
    move, said = AFAR[where]
    arm, loop = Simulated(law), ControlLoop(law, H)
    begin = arm.q[0].copy()
    arm.q = move(arm.q[0])[None].copy()
    loop.start(arm.q[0])
    assert (loop.status.mode, loop.status.faults) == (Mode.DAMP, {"start": 1})
    assert said in loop.status.reason
    loop.resume()
    weight = law.robot.gravity(arm.q[0])
    done = arm.drive(loop, 60)
    assert loop.status.mode == Mode.DAMP
    np.testing.assert_allclose(done["tau"][0], np.clip(weight, -loop.envelope.torque, loop.envelope.torque))
    assert np.abs(done["qd"]).max() < 0.02  # it stays where it was put
    arm.q = begin[None].copy()  # somebody brings it to its path
    loop.start(arm.q[0], arm.qd[0], arm.t)
    arm.drive(loop, 50)
    assert (loop.status.mode, loop.status.faults) == (Mode.RUN, {})


def test_a_start_beyond_a_limit_of_the_envelope_is_damped_also_where_there_is_no_tube():
    law = law_of(2)
    loop = ControlLoop(law, H, Envelope(tube=np.inf, lower=-1.0, upper=1.5))
    loop.start([0.2, 1.6])
    assert loop.status.mode == Mode.DAMP
    assert "limits of -1 to 1.5 rad" in loop.status.reason
    loop.start([0.2, 1.4])
    assert loop.status.mode == Mode.RUN


@pytest.mark.parametrize("n", [2, 6, 7])
def test_a_step_without_a_start_starts_where_the_arm_is(n):
    law = law_of(n)
    (arm, loop), started = (Simulated(law), ControlLoop(law, H)), ControlLoop(law, H)
    arm.t = 1234.5
    assert loop.status.mode == Mode.DAMP
    assert loop.status.reason == "it has not been started"
    loop.step(None, None, None)
    loop.resume()
    assert loop.status.mode == Mode.DAMP
    started.start(arm.q[0], arm.qd[0], arm.t)
    tau = started.step(arm.q[0], arm.qd[0], arm.t)
    assert (loop.step(arm.q[0], arm.qd[0], arm.t) == tau).all()
    assert loop.status == started.status
    afar = ControlLoop(law, H)
    away = arm.q[0] + 1.0
    np.testing.assert_allclose(
        afar.step(away, np.zeros(n), 0.0),
        np.clip(law.robot.gravity(away), -loop.envelope.torque, loop.envelope.torque),
    )
    assert afar.status.mode == Mode.DAMP


def test_a_hold_or_a_stop_before_the_first_step_lasts():
    law = law_of(2)
    for act, mode in ((lambda loop: loop.hold(), Mode.HOLD), (lambda loop: loop.stop("not yet"), Mode.DAMP)):
        arm, loop = Simulated(law), ControlLoop(law, H)
        act(loop)
        arm.drive(loop, 5)
        assert loop.status.mode == mode


def test_a_plan_that_is_held_outside_the_tube_goes_on_inside_only():
    law = law_of(2, pc.ExtendedMotionPlan)
    arm, loop = Simulated(law), ControlLoop(law, H, Envelope(tube=0.2, jump=10.0))
    loop.start(arm.q[0], arm.qd[0])
    arm.drive(loop, 50)
    arm.q = arm.q + np.array([0.25, 0.0])
    arm.drive(loop, 1)
    assert loop.status.mode == Mode.HOLD
    loop.resume()
    assert loop.status.mode == Mode.HOLD
    assert "bring it there" in loop.status.reason
    arm.drive(loop, 300)  # the law brings it back to where the plan rests
    loop.resume()
    assert loop.status.mode == Mode.RUN


@pytest.mark.parametrize("broken", [lambda q: 1 / 0, lambda q: np.full(2, np.nan), lambda q: "torque"])
def test_a_law_that_breaks_is_damped(broken):
    class Broken(pc.MotionController):
        gains = ()
        breaks = False

        def torque(self, q, qd, at):
            if self.breaks:
                return broken(q)
            return self.robot.gravity(q) + 100 * at.position_error + 20 * at.velocity_error

    law = Broken(law_of(2).robot, law_of(2).task)
    arm, loop = Simulated(law), ControlLoop(law, H)
    loop.start(arm.q[0], arm.qd[0])
    arm.drive(loop, 20)
    assert loop.status.mode == Mode.RUN
    law.breaks = Broken.breaks = True
    done = arm.drive(loop, 100)
    assert loop.status.mode == Mode.DAMP
    assert np.isfinite(done["tau"]).all()
    assert np.abs(arm.qd).max() < 1e-2


# --- arguments -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("joint", "unit"), [("lift", "m"), ("turn", "rad")])
def test_reasons_name_the_joint_and_its_unit(joint, unit):
    task = pc.Ellipse(semi_axes=[0.2, 0.5], speed=1.0)
    loop = ControlLoop(pc.Projection(pc.load_robot(GANTRY), task, k_p=200.0, K_v=28.0), H)
    q, move = task.q_d(np.array(0.0)), np.array([joint == "lift", joint == "turn"], dtype=float)
    for position, velocity, said in (
        (q, 8.0 * move, f"{joint} moves at 8 {unit}/s, its limit is"),
        (q + 1.9 * move, 0.0 * move, f"the position of {joint} jumps by 1.9 {unit}"),
    ):
        loop.start(q)
        for k in range(7):
            loop.step(position, velocity, k * H)
        assert said in loop.status.reason
    loop.start(q + 2.0 * move)
    assert " rad and m from the path, the tube is 0.5 rad and m" in loop.status.reason


def test_a_pace_that_counts_on_more_than_the_envelope_lets_through_is_questioned():
    law, torque = law_of(2), [75.0, 15.0]  # of 150 and 15 N m
    paced = pc.Paced(law)
    with pytest.warns(pc.PathControlWarning, match=r"150 N m at joint_1, the envelope lets 75 through"):
        ControlLoop(pc.SpeedOverride(paced), H, Envelope(torque=torque))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ControlLoop(pc.Paced(law, torque_limits=torque), H, Envelope(torque=torque))
        ControlLoop(paced, H)
        ControlLoop(law, H, Envelope(torque=torque))


def test_limits_that_are_missing_or_wrong_are_told():
    law = law_of(2)
    for bad in ({"torque": -1.0}, {"torque_rate": [1.0, 0.0]}, {"velocity": np.nan}, {"tube": 0.0}, {"patience": 0.5}):
        with pytest.raises(InputError, match=next(iter(bad))):
            Envelope(**bad)
    for bad in ({"tube": "wide"}, {"late": None}, {"lost": "x"}, {"lower": "a"}, {"tube": [1.0, 2.0]}):
        with pytest.raises(InputError, match=next(iter(bad))):
            Envelope(**bad)
    with pytest.raises(InputError, match="expected an Envelope"):
        ControlLoop(law, H, {"torque": 1.0})
    with pytest.raises(InputError, match="late"):
        Envelope(late=3.0, lost=2.0)
    with pytest.raises(InputError, match="not below"):
        ControlLoop(law, H, Envelope(lower=1.0, upper=0.0))
    with pytest.raises(InputError, match=r"expected a number or \(2,\)"):
        ControlLoop(law, H, Envelope(torque=[1.0, 2.0, 3.0]))
    with pytest.raises(InputError, match="period"):
        ControlLoop(law, 0.0)
    with pytest.raises(InputError, match="q has"):
        ControlLoop(law, H).start([0.0])
    for start in (ControlLoop(law, H).start, pc.PositionCommand(law, H).start):
        with pytest.raises(InputError, match=r"q has the shape \(3, 2\), expected \(2,\)"):
            start(np.zeros((3, 2)))
        with pytest.raises(InputError, match="qd"):
            start(np.zeros(2), [np.nan, 0.0])
