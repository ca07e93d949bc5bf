"""What an analysis becomes: pages, pictures, JSON, netCDF, text in the terminal."""
