"""How exact the engines are: settings, run and page."""
