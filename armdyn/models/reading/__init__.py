"""From an untrusted URDF or model to Pinocchio's model of an arm."""
