"""Claims of the paper, measured: its first approach, payloads that can be held, sections 6.1 to 6.3."""
