"""One offline page that shows what was recorded, what came of it, and where the model fails.

    recordings, tables, model results
        --sections--> Section (text, figures, small tables; plain data)
        --page-----> one HTML file: plotting library, style, data and script inside, a content
                     security policy that forbids the rest

The report holds no estimator and no statistic: it reads tables, or calls the functions behind the
commands, and draws. What cannot be shown is named, with the command that would make it. Nothing
that comes from a log, a setup or a file name reaches the page unescaped.
"""
