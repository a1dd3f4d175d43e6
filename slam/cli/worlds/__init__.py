"""Commands about worlds and recordings: show and check worlds, simulate a drive through one, export a recording."""
