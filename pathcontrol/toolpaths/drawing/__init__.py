"""What drawings of both kinds are made of: pieces, chained into contours, some left out, some there twice."""
