"""From a stranger's URDF or model to Pinocchio's model of an arm."""
