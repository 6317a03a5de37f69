"""A folder that a shuttle accepts: pins, sources, test, documentation and settings of its flow."""
