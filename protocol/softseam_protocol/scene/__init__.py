"""What a scene may say: one spec a concept, and the file that says it."""
