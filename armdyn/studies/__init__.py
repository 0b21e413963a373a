"""Whole studies: one motion of many robots (`sweep`), and the paper, reproduced (`paper`)."""
