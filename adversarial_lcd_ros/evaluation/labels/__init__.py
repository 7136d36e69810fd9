"""Labels of a sequence, shown before anything is evaluated."""
