"""The bus: whoever asks, answers, publishes and listens, and who of them lives; the only place that imports zenoh."""
