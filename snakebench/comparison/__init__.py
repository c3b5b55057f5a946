"""What joins the studies: claims, the ledger of gains, assumptions and the index page."""
