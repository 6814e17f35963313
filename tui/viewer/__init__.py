"""The viewer: its app, the session that it shows, its actions, its launch, its plain-text form."""
