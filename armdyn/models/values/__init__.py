"""Values of arms: specs, payloads, limits, friction; and the URDF of a spec."""
