"""What the paper claims, measured: its first approach, the payloads that can be held, sections 6.1 to 6.3."""
