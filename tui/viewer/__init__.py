"""The viewer: its app, its session, its actions, its launch, and its plain-text form."""
