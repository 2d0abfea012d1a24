"""Memory of records is used again, and never while somebody holds a part of it."""

import gc
import os
import sys

import numpy as np
import pytest

import pathcontrol as pc
from pathcontrol.simulation import record_memory
from pathcontrol.simulation.record_memory import new_block

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="memory is kept on Linux only")
SAMPLE = np.dtype([("q", np.float64, (3,)), ("s", np.float64)])
COUNT = 200_000


@pytest.fixture(autouse=True)
def _nothing_is_kept_yet():
    gc.collect()
    record_memory._kept.clear()


def address(block):
    return block.__array_interface__["data"][0]


def test_a_block_is_used_again_when_no_view_of_it_is_left():
    block = new_block(COUNT, SAMPLE)
    where, view = address(block), block["q"][10:20, :2].T
    view[...] = 3.0
    del block
    other = new_block(COUNT, SAMPLE)
    assert address(other) != where
    other["q"] = 4.0
    assert (view == 3.0).all()
    del view
    assert address(new_block(COUNT, SAMPLE)) == where


@pytest.mark.parametrize(("share", "fits"), [(1.0, True), (0.7, True), (0.3, False)])
def test_memory_is_used_for_a_record_that_is_not_much_smaller(share, fits):
    block = new_block(4 * COUNT, SAMPLE)
    where = address(block)
    del block
    other = new_block(int(4 * COUNT * share), SAMPLE)
    assert len(other) == int(4 * COUNT * share)
    assert (address(other) == where) == fits


def test_no_more_than_a_quarter_of_a_gibibyte_is_kept():
    sizes = [COUNT * k for k in range(1, 12)]  # 6.4 MB each time k
    blocks = [new_block(size, SAMPLE) for size in sizes]
    del blocks
    assert 0 < sum(map(len, record_memory._kept)) <= 2**28


def test_small_blocks_are_plain_arrays():
    assert new_block(3, SAMPLE).flags.owndata


def test_a_fork_does_not_write_into_the_blocks_of_its_parent():
    block = new_block(COUNT, SAMPLE)
    block["s"] = 1.0
    child = os.fork()
    if not child:
        block["s"] = 2.0
        os._exit(0)
    os.waitpid(child, 0)
    assert (block["s"] == 1.0).all()


def test_runs_are_the_same_in_used_memory_and_do_not_change_one_another():
    robot = pc.load_robot("cicese_2dof")
    task = pc.Circle(radius=0.5, speed=3.0, center=(0.2, -0.3))
    law = pc.ExtendedMotionPlan(robot, task, K_p=800.0, K_v=100.0, k=40.0)
    starts = np.linspace([0.0, 0.0], [0.5, -0.5], 200)

    def run():
        return pc.simulate(law, starts, duration=1.0, loop=pc.SampledLoop(period=2.5e-3), progress=False)

    first = run()
    kept = {name: first.array(name).copy() for name in ("q", "qd", "tau", "s", "regular")}
    run()  # its memory is used again by the next
    again = run()
    for name, expected in kept.items():
        np.testing.assert_array_equal(again.array(name), expected)
        np.testing.assert_array_equal(first.array(name), expected)
