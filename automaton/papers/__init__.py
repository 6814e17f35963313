"""Reproductions of published studies: their tables beside ours."""
