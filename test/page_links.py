# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a page of HTML would load, and what it says."""

from html.parser import HTMLParser


class Links(HTMLParser):
    """Collects whatever a page would load, and its text, white space folded."""

    def __init__(self, text):
        super().__init__()
        self.sources, self.text = [], ''
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.sources += [value for name, value in attributes
                         if name in ('src', 'srcset', 'href', 'action', 'data')]

    def handle_data(self, data):
        self.text += ' ' + ' '.join(data.split())
