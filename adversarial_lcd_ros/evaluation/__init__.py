"""How much accuracy was lost: labels, protocols, statistics, report."""
