"""Build bitstreams: synthesis, place and route, report of area and clock."""
