"""The look of the pictures, raster pictures of events, and files of data and picture."""
