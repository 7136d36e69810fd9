"""The experiments of the paper: statistics over sequences, ranks, tables, figures, report."""
