"""What goes in: images, the presets that scan them, and the event rates that come out."""
