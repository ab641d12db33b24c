'use strict';
/* Slides: keys turn them, each has its number; arrows up and down scroll one that is taller than the screen. */
{
  const slides = [document.querySelector('header'), ...document.querySelectorAll('main > section')];
  const far = slide => Math.abs(slide.getBoundingClientRect().top);
  const turns = {
    ArrowRight: k => k + 1, PageDown: k => k + 1, ' ': k => k + 1, ArrowLeft: k => k - 1, PageUp: k => k - 1,
    Home: () => 0, End: () => slides.length - 1,
  };
  slides.forEach((slide, k) => { slide.dataset.number = `${k + 1} / ${slides.length}`; });
  document.addEventListener('keydown', event => {
    const turn = turns[event.key];
    if (!turn || event.ctrlKey || event.altKey || event.metaKey || event.target.closest('summary, a')) return;
    event.preventDefault();
    const now = slides.reduce((best, slide, k) => (far(slide) < far(slides[best]) ? k : best), 0);
    slides[Math.max(0, Math.min(slides.length - 1, turn(now)))].scrollIntoView();
  });
}
