"""The datasheet of a readout: a page and its pictures, for one configuration."""
