"""Read cell libraries; identify cells by their Liberty description, never by name."""
