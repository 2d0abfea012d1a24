"""The arm: rigid-body model, friction, URDF checks. The only floor that knows Pinocchio."""
