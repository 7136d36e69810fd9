"""Weisfeiler-Lehman features and kernels."""
