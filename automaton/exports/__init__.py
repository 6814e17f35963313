"""What can be shown of a run: recordings, their verification, and its history."""
