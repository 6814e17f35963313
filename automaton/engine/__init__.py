"""The physics: the state, the tick and their observation; imports no other package of the project."""
