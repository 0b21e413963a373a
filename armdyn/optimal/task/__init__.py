"""Settings of a solve: options, transcription scheme, policy, and the task that holds them."""
