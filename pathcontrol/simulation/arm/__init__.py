"""The simulated arm: its dynamics with friction, its sensors and its disturbances."""
