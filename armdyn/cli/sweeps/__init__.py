"""The sweep command: a robot with many payloads, or a study file's cases."""
