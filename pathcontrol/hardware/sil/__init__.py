"""Software in the loop: an arm in MuJoCo, in a process of its own, behind a network that loses packets."""
