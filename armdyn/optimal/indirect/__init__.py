"""The paper's second approach: Pontryagin's canonical system as equations."""
