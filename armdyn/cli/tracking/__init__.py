"""Commands about controllers: runs, many arms, tuning."""
