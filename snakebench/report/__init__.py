"""What every page uses: tables, figures, animation and templates."""
