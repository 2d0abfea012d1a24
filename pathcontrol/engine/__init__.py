"""The compiled engine: the sampled loop, nearest points and one control tick, in C++ without dependencies."""
