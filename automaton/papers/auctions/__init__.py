"""De Ryck et al.: auctions with the cost of charging in the bids."""
