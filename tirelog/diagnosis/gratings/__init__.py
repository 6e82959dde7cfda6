"""Which grating says what: to road, wheel or one grating alone belongs what repeats.

    residual and slopes of each grating, whitened -> normal equations by manoeuvre with free shapes
        over the road's angle (0 at the patch) and the wheel's (that plus the grating's place)
        -> sign flips of manoeuvres with the maximum over {road, wheel, each grating alone}
        -> the largest comes in, and the rest is asked again: what each frame holds
    the same with one strength of an effect for each grating -> its strengths, and whether they
        differ by more than chance (Q, by the same flips)

For one grating road and wheel are the same function of the angle; several at other places see a
wheel's shape shifted and a road's not. What a single grating shows and no other does is not the
tire's: its bonding, its channel.
"""
