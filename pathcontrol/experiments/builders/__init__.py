"""The objects that an experiment file names, made of its validated sections."""
