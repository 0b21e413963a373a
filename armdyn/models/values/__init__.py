"""What arms are made of, as values: specs, payloads, limits, friction; and a URDF written from a spec."""
