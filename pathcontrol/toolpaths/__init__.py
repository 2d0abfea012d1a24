"""Tool paths: contours of lines, arcs and Bézier curves as files describe them, and smooth curves made of them."""
