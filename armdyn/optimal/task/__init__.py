"""How it is gone about: options, scheme, policy, and all of them together as one task."""
