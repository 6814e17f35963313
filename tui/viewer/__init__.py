"""The viewer: its app, how it is launched, and its plain-text form."""
