"""Second methods: mechanics written again from first principles, sharing no code with the model."""
